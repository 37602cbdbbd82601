"""How fast the base may move, and how late it obeys. Shared by controller, monitor and recovery."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Twist2
from thumper.common.kinematics import DriveGeometry


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimits:
    """Limits of the commanded twist."""

    # Fastest forward speed [m/s]. The drive's wheels at 17 rad/s make 1 m/s.
    v_max_m_s: Annotated[float, Interval(gt=0, le=1.0)] = 0.4
    # Fastest turn [rad/s].
    w_max_rad_s: Annotated[float, Interval(gt=0, le=6.0)] = 1.2
    # Forward acceleration and braking [m/s^2].
    v_accel_m_s2: Annotated[float, Interval(gt=0, le=10.0)] = 0.4
    # Turn acceleration and braking [rad/s^2].
    w_accel_rad_s2: Annotated[float, Interval(gt=0, le=50.0)] = 1.5
    # Rate at which the board changes the speed of each wheel [rad/s^2]: its parameter `acceleration`.
    wheel_accel_rad_s2: Annotated[float, Gt(0)] = 8.0
    # Time from a command until the base moves accordingly [s].
    latency_s: Annotated[float, Interval(ge=0, le=2.0)] = 0.2


def stoppable_speed(distance: float, accel: float, latency_s: float) -> float:
    """Fastest speed from which braking after `latency_s` ends within `distance` (SI; metres or radians).

    Solves distance = v latency + v^2 / (2 accel).
    """
    delay = accel * latency_s
    return math.sqrt(delay * delay + 2.0 * accel * max(0.0, distance)) - delay


def step_toward(value: float, target: float, change: float) -> float:
    """Move `value` toward `target` by at most `change`."""
    return min(max(target, value - change), value + change)


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelRamp:
    """Rate of the wheels' rims, and how far from the middle they run."""

    rim_m_s2: float
    half_track_m: float

    @classmethod
    def of(cls, limits: SpeedLimits, drive: DriveGeometry | None = None) -> "WheelRamp":
        """Return the ramp of a drive; by default the Wild Thumper's."""
        drive = drive or DriveGeometry()
        return cls(
            rim_m_s2=limits.wheel_accel_rad_s2 * drive.wheel_radius_m, half_track_m=0.5 * drive.track_m
        )

    def braking_s(self, twist: Twist2) -> float:
        """Time until both sides stand [s]."""
        return (abs(twist.v_m_s) + self.half_track_m * abs(twist.w_rad_s)) / self.rim_m_s2

    def braked(self, twist: Twist2, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """v [m/s] and w [rad/s], shape (n,) each, at times since the zero command [s]."""
        turn_m_s = self.half_track_m * twist.w_rad_s
        left_m_s, right_m_s = (
            np.sign(rim) * np.maximum(0.0, abs(rim) - self.rim_m_s2 * times_s)
            for rim in (twist.v_m_s - turn_m_s, twist.v_m_s + turn_m_s)
        )
        return 0.5 * (left_m_s + right_m_s), 0.5 * (right_m_s - left_m_s) / self.half_track_m


def is_still(twist: Twist2) -> bool:
    """Whether the base has as good as stopped."""
    return abs(twist.v_m_s) < 0.03 and abs(twist.w_rad_s) < 0.10
