"""Log of a run for plots and tables: one row per control tick, in memory."""

from dataclasses import dataclass, field
from typing import ClassVar, TypeVar

import numpy as np

from thumper.board.board import TelemetrySample
from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.state import Transition

SPEED_COLUMNS = (
    "time_s",
    "left_setpoint",
    "left_speed",
    "left_pwm",
    "right_setpoint",
    "right_speed",
    "right_pwm",
    "battery_V",
)


MAX_ROWS, MAX_PLANS = 72_000, 400  # rows of two hours at 10 Hz; a patrol may last for days
T = TypeVar("T")


class Thinned(list[T]):
    """A list that stays below `limit`: when it is full, every second item goes, and of later ones as many."""

    def __init__(self, limit: int) -> None:
        super().__init__()
        self._limit, self._stride, self._count = limit, 1, 0

    def append(self, item: T) -> None:
        """Add an item, unless it is one of those that are left out by now."""
        if self._count % self._stride == 0:
            super().append(item)
        self._count += 1
        if len(self) >= self._limit:
            del self[1::2]
            self._stride *= 2


@dataclass(slots=True, repr=False)
class DriveLog:
    """Log of all drives; `poses` and `speeds` return it as arrays. A long log becomes coarser, not longer."""

    SPEED_COLUMNS: ClassVar = SPEED_COLUMNS  # the names of the columns of `speeds`

    _poses: list[tuple[float, float, float, float]] = field(default_factory=lambda: Thinned(MAX_ROWS))
    _speeds: list[tuple[float, ...]] = field(default_factory=lambda: Thinned(MAX_ROWS))
    # States of the navigator, and each new global plan, shape (n, 2) [m] in `map`.
    transitions: list[Transition] = field(default_factory=lambda: Thinned(MAX_ROWS))
    plans: list[FloatArray] = field(default_factory=lambda: Thinned(MAX_PLANS))

    def __repr__(self) -> str:
        return f"<DriveLog: {len(self._poses)} poses, {len(self._speeds)} speeds, {len(self.plans)} plans>"

    def add_pose(self, time_s: float, map_from_base: Pose2) -> None:
        """Add the estimated pose."""
        self._poses.append((time_s, map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad))

    def add_speeds(self, sample: TelemetrySample) -> None:
        """Add set-points, speeds, PWM and battery voltage of one control tick."""
        t = sample.telemetry
        left = (t.left_setpoint / 1000, t.left_speed / 1000, float(t.left_pwm))
        right = (t.right_setpoint / 1000, t.right_speed / 1000, float(t.right_pwm))
        self._speeds.append((sample.time_s, *left, *right, t.battery_mV / 1000))

    def add_plan(self, plan_m: FloatArray) -> None:
        """Add a global plan unless it equals the last one."""
        if plan_m.size and not (self.plans and np.array_equal(self.plans[-1], plan_m)):
            self.plans.append(plan_m.copy())

    @property
    def poses(self) -> FloatArray:
        """The poses: time [s], x [m], y [m], heading [rad] in `map`; shape (n, 4)."""
        return np.array(self._poses, dtype=np.float64).reshape(-1, 4)

    @property
    def speeds(self) -> FloatArray:
        """The wheels at each control tick, shape (n, 8); `SPEED_COLUMNS` names the columns.

        Time [s]; set-point and speed [rad/s] and PWM (of 255) of the left wheels, then of the right ones; the
        battery voltage [V].
        """
        return np.array(self._speeds, dtype=np.float64).reshape(-1, len(SPEED_COLUMNS))


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedError:
    """Set-point minus measured wheel speed over a run [rad/s]."""

    mean_rad_s: float
    std_rad_s: float


def speed_errors(speeds: FloatArray) -> dict[str, SpeedError]:
    """Return each side's error from an array with `SPEED_COLUMNS`, over the rows in which the robot moves.

    The set-point is the input of the wheel's controller: the commanded speed after the firmware's ramp.
    """
    columns = [
        SPEED_COLUMNS.index(f"{side}_{what}") for side in ("left", "right") for what in ("setpoint", "speed")
    ]
    moving = (speeds[:, columns] != 0.0).any(axis=1)
    speeds = speeds[moving] if moving.any() else speeds
    errors = {}
    for side in ("left", "right"):
        error = (
            speeds[:, SPEED_COLUMNS.index(f"{side}_setpoint")]
            - speeds[:, SPEED_COLUMNS.index(f"{side}_speed")]
        )
        errors[side] = SpeedError(mean_rad_s=float(error.mean()), std_rad_s=float(error.std()))
    return errors


def path_length_m(poses: FloatArray) -> float:
    """Return the path length [m] from an array with columns time, x, y, heading."""
    return float(np.hypot(np.diff(poses[:, 1]), np.diff(poses[:, 2])).sum())
