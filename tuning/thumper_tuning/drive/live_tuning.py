"""Tune while driving: ramp gains without a bump, read the controller's internal signals, revert, save.

The board's integral is in units of its output, so a change of `ki` causes no step. A change of `kp` or of the
feed-forward does. So gains change in small steps, one per tick, and the integral follows (bumpless transfer).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Annotated

from annotated_types import Ge, Le

from thumper.board.board import Board, TelemetrySample
from thumper.common.errors import ThumperError
from thumper_tuning.design.fixed_point import BoardGains, to_fixed_point
from thumper_tuning.drive.board_gains import read_gains

INTEGRAL_UNITS_PER_PWM = 64.0
MAX_PWM = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveTuningOptions:
    """How gently gains change."""

    ramp_ticks: Annotated[int, Ge(1), Le(200)] = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelControllerState:
    """One wheel's controller in the last tick."""

    setpoint_rad_s: float
    speed_rad_s: float
    integral_pwm: float
    # None if the integral does not reveal it: first tick, ki = 0, or output at its limit.
    proportional_pwm: float | None
    feedforward_pwm: float | None
    pwm: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerState:
    """Both wheels' controllers, with the time on the host's clock."""

    time_s: float
    left: WheelControllerState
    right: WheelControllerState


class LiveTuning:
    """Changes gains while another program drives. Call `tick` with each sample, in the board's thread."""

    def __init__(self, board: Board, options: LiveTuningOptions | None = None) -> None:
        self._board = board
        self._options = options or LiveTuningOptions()
        self.original = read_gains(board)
        self.gains = self.original  # the board's current gains
        self._ramp: list[BoardGains] = []
        self._previous: TelemetrySample | None = None
        self._period_s = 1.0 / board.identity.control_rate_Hz

    @property
    def is_ramping(self) -> bool:
        """Whether the gains are still changing."""
        return bool(self._ramp)

    def set_gains(self, **changed: float) -> BoardGains:
        """Ramp to new values of some gains from the next tick on; return the final gains.

        Raises
        ------
        ThumperError
            A value is out of the board's range. Nothing is changed.
        TypeError
            There is no such gain.
        """
        target = to_fixed_point(**{**dict(self.gains.items()), **changed})
        ticks = self._options.ramp_ticks
        self._ramp = [_interpolate(self.gains, target, (k + 1) / ticks) for k in range(ticks - 1)]
        self._ramp.append(target)
        return target

    def tick(self, sample: TelemetrySample) -> ControllerState:
        """Advance the ramp, and return the controllers' state.

        Raises
        ------
        ThumperError
            The board rejects a gain or does not answer.
        """
        state = self._controller_state(sample)  # with the gains that produced it, before they change
        if self._ramp:
            step = self._ramp.pop(0)
            for name, value in step.items():
                if value != getattr(self.gains, name):
                    self._board.set_parameter(name, value)
                    self.gains = replace(self.gains, **{name: value})
        return state

    def revert(self) -> BoardGains:
        """Ramp back to the original gains."""
        return self.set_gains(**dict(self.original.items()))

    def save(self) -> Iterator[None]:
        """Save the board's parameters in its memory. `revert` still goes back to the original gains.

        Yields until the board has written them: send commands meanwhile.

        Raises
        ------
        ThumperError
            The gains are still changing, the battery is low or the memory is worn out. The board still has
            the gains saved before.
        """
        if self._ramp:
            raise ThumperError("the gains are still changing; save them after the ramp")
        return self._board.save()

    def _controller_state(self, sample: TelemetrySample) -> ControllerState:
        t, previous = sample.telemetry, self._previous
        consecutive = previous is not None and 0.0 < sample.time_s - previous.time_s < 1.5 * self._period_s
        left = previous.telemetry.left_integral if previous and consecutive else None
        right = previous.telemetry.right_integral if previous and consecutive else None
        self._previous = sample
        return ControllerState(
            time_s=sample.time_s,
            left=self._wheel_state(t.left_setpoint, t.left_speed, left, t.left_integral, t.left_pwm),
            right=self._wheel_state(t.right_setpoint, t.right_speed, right, t.right_integral, t.right_pwm),
        )

    def _wheel_state(
        self, setpoint: int, speed: int, previous_integral: int | None, integral: int, pwm: int
    ) -> WheelControllerState:
        """Split the output into its parts.

        The PI acts on an error against the model's prediction, which the board does not send. The change of
        the integral, `ki` times that error, reveals it, except where the ramp arrives at zero: there the
        board drops the integral.
        """
        integral_pwm = integral / INTEGRAL_UNITS_PER_PWM
        proportional: float | None = None
        if setpoint == 0 and integral == 0:
            proportional = 0.0  # the board clears the integral at rest
        elif previous_integral is not None and self.gains.ki > 0.0 and abs(pwm) < MAX_PWM:
            change_pwm = integral_pwm - previous_integral / INTEGRAL_UNITS_PER_PWM
            proportional = self.gains.kp / self.gains.ki * change_pwm
        return WheelControllerState(
            setpoint_rad_s=setpoint / 1000.0,
            speed_rad_s=speed / 1000.0,
            integral_pwm=integral_pwm,
            proportional_pwm=proportional,
            feedforward_pwm=None if proportional is None else pwm - integral_pwm - proportional,
            pwm=pwm,
        )


def _interpolate(start: BoardGains, end: BoardGains, share: float) -> BoardGains:
    values = {}
    for entry in fields(start):
        first = getattr(start, entry.name)
        values[entry.name] = first + share * (getattr(end, entry.name) - first)
    return to_fixed_point(**values)
