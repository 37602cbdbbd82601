"""Tuning in flight: gains glide without a bump, the controller's inner variables stream, revert and save.

The board's integral is in units of its output, so a changed `ki` makes no step by itself; a changed `kp` or
feed-forward does, and therefore goes there in small steps, one a tick, that the integral follows.
"""

from dataclasses import dataclass, fields, replace
from typing import Annotated

from annotated_types import Ge, Le

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Command
from thumper.common.errors import ThumperError
from thumper_tuning.design.fixed_point import BoardGains, on_the_wire
from thumper_tuning.drive.board_gains import read_gains

INTEGRAL_STEPS_PER_PWM = 64.0
LARGEST_PWM = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOptions:
    """How gently gains change."""

    glide_ticks: Annotated[int, Ge(1), Le(200)] = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelInside:
    """One wheel's controller in the tick just ended."""

    setpoint_rad_s: float
    speed_rad_s: float
    integral_pwm: float
    # None: the integral does not tell it (first tick, ki = 0, output at its limit).
    proportional_pwm: float | None
    feedforward_pwm: float | None
    pwm: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Inside:
    """Both wheels' controllers at a time on the host's clock."""

    time_s: float
    left: WheelInside
    right: WheelInside


class LiveTuning:
    """Beside whoever drives: give `tick` each telemetry sample, from the thread that owns the board."""

    def __init__(self, board: Board, options: LiveOptions | None = None) -> None:
        """Remember the board's gains, to go back to."""
        self._board = board
        self._options = options or LiveOptions()
        self.original = read_gains(board)
        self.gains = self.original  # what the board works with now
        self._path: list[BoardGains] = []
        self._before: TelemetrySample | None = None
        self._period_s = 1.0 / board.identity.control_rate_Hz

    @property
    def gliding(self) -> bool:
        """Whether gains are still on their way."""
        return bool(self._path)

    def set_gains(self, **changed: float) -> BoardGains:
        """Glide to new values of some of the gains, from the next tick on; return where it will end.

        Raises
        ------
        ThumperError
            A value does not fit the board; nothing is changed then.
        TypeError
            There is no such gain.
        """
        target = on_the_wire(**{**dict(self.gains.items()), **changed})
        ticks = self._options.glide_ticks
        self._path = [_between(self.gains, target, (k + 1) / ticks) for k in range(ticks - 1)]
        self._path.append(target)
        return target

    def tick(self, sample: TelemetrySample) -> Inside:
        """Take the next step of a glide, and tell what the controllers did.

        Raises
        ------
        ThumperError
            The board refuses a gain or does not answer.
        """
        inside = self._inside(sample)  # with the gains that it worked with, before they move on
        if self._path:
            step = self._path.pop(0)
            for name, value in step.items():
                if value != getattr(self.gains, name):
                    self._board.set_parameter(name, value)
                    self.gains = replace(self.gains, **{name: value})
        return inside

    def revert(self) -> BoardGains:
        """Glide back to the gains that were there at the beginning."""
        return self.set_gains(**dict(self.original.items()))

    def save(self) -> None:
        """Have the board keep its parameters over resets; what `revert` goes back to stays.

        Raises
        ------
        ThumperError
            A glide is under way, the battery is low or the memory is worn out; the old ones are still saved.
        """
        if self._path:
            raise ThumperError("the gains are still on their way; save them when they have arrived")
        self._board.command(Command.SAVE)

    def _inside(self, sample: TelemetrySample) -> Inside:
        t, before = sample.telemetry, self._before
        known = before is not None and 0.0 < sample.time_s - before.time_s < 1.5 * self._period_s
        left = before.telemetry.left_integral if before and known else None
        right = before.telemetry.right_integral if before and known else None
        self._before = sample
        return Inside(
            time_s=sample.time_s,
            left=self._wheel(t.left_setpoint, t.left_speed, left, t.left_integral, t.left_pwm),
            right=self._wheel(t.right_setpoint, t.right_speed, right, t.right_integral, t.right_pwm),
        )

    def _wheel(self, setpoint: int, speed: int, before: int | None, integral: int, pwm: int) -> WheelInside:
        """The PI acts on an error against the model's expectation, which is not sent: the integral's growth,
        `ki` times that error, tells it."""
        kept = integral / INTEGRAL_STEPS_PER_PWM
        proportional: float | None = None
        if setpoint == 0 and integral == 0:
            proportional = 0.0  # at rest the board clears the integral
        elif before is not None and self.gains.ki > 0.0 and abs(pwm) < LARGEST_PWM:
            growth_pwm = kept - before / INTEGRAL_STEPS_PER_PWM
            proportional = self.gains.kp / self.gains.ki * growth_pwm
        return WheelInside(
            setpoint_rad_s=setpoint / 1000.0,
            speed_rad_s=speed / 1000.0,
            integral_pwm=kept,
            proportional_pwm=proportional,
            feedforward_pwm=None if proportional is None else pwm - kept - proportional,
            pwm=pwm,
        )


def _between(start: BoardGains, end: BoardGains, share: float) -> BoardGains:
    values = {}
    for entry in fields(start):
        begin = getattr(start, entry.name)
        values[entry.name] = begin + share * (getattr(end, entry.name) - begin)
    return on_the_wire(**values)
