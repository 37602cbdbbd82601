"""Limits of speed, acceleration and latency. Shared by controllers, collision monitor and recoveries."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Twist2
from thumper.common.kinematics import DriveGeometry


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimits:
    """Limits of the commanded twist, and how the base responds to it."""

    # Highest forward speed [m/s]. 17 rad/s of the wheels are 1 m/s.
    v_max_m_s: Annotated[float, Interval(gt=0, le=1.0)] = 0.4
    # Highest turn rate [rad/s].
    w_max_rad_s: Annotated[float, Interval(gt=0, le=6.0)] = 1.2
    # Forward acceleration and braking [m/s^2].
    v_accel_m_s2: Annotated[float, Interval(gt=0, le=10.0)] = 0.4
    # Turn acceleration and braking [rad/s^2].
    w_accel_rad_s2: Annotated[float, Interval(gt=0, le=50.0)] = 1.5
    # Acceleration of each wheel [rad/s^2]: the board's parameter `acceleration`.
    wheel_accel_rad_s2: Annotated[float, Gt(0)] = 8.0
    # Deceleration of each wheel [rad/s^2]: the board's parameter `deceleration`.
    wheel_decel_rad_s2: Annotated[float, Gt(0)] = 16.0
    # Time from a command until the base responds [s].
    latency_s: Annotated[float, Interval(ge=0, le=2.0)] = 0.2


def stoppable_speed(distance: float, accel: float, latency_s: float) -> float:
    """Return the highest speed from which braking after `latency_s` ends within `distance` (m or rad).

    Solves distance = v latency + v^2 / (2 accel).
    """
    delay = accel * latency_s
    return math.sqrt(delay * delay + 2.0 * accel * max(0.0, distance)) - delay


def step_toward(value: float, target: float, change: float) -> float:
    """Move `value` toward `target` by at most `change`."""
    return min(max(target, value - change), value + change)


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelRamp:
    """Acceleration and braking of the wheels' rims, and their distance from the middle of the robot."""

    accel_m_s2: float
    decel_m_s2: float
    half_track_m: float

    @classmethod
    def from_drive(cls, limits: SpeedLimits, drive: DriveGeometry | None = None) -> "WheelRamp":
        """Return the ramp of a drive; by default the Wild Thumper's."""
        drive = drive or DriveGeometry()
        return cls(
            accel_m_s2=limits.wheel_accel_rad_s2 * drive.wheel_radius_m,
            decel_m_s2=limits.wheel_decel_rad_s2 * drive.wheel_radius_m,
            half_track_m=0.5 * drive.track_m,
        )

    def step(self, rim_m_s: float, target_m_s: float, elapsed_s: float) -> float:
        """Return a rim's next speed [m/s], as the firmware's ramp.hpp."""
        step_m_s = self.accel_m_s2 * elapsed_s
        if (target_m_s - rim_m_s) * rim_m_s >= 0.0 or abs(rim_m_s) <= step_m_s:
            return step_toward(rim_m_s, target_m_s, step_m_s)
        if abs(target_m_s - rim_m_s) <= step_m_s:
            return target_m_s
        slowest_m_s = target_m_s if target_m_s * rim_m_s > 0.0 else 0.0
        return step_toward(rim_m_s, slowest_m_s, self.decel_m_s2 * elapsed_s)

    def braking_s(self, twist: Twist2) -> float:
        """Return the time until both sides have stopped [s]."""
        return (abs(twist.v_m_s) + self.half_track_m * abs(twist.w_rad_s)) / self.decel_m_s2

    def braked(self, twist: Twist2, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return v [m/s] and w [rad/s], shape (n,) each, at times since the zero command [s]."""
        turn_m_s = self.half_track_m * twist.w_rad_s
        left_m_s, right_m_s = (
            np.sign(rim) * np.maximum(0.0, abs(rim) - self.decel_m_s2 * times_s)
            for rim in (twist.v_m_s - turn_m_s, twist.v_m_s + turn_m_s)
        )
        return 0.5 * (left_m_s + right_m_s), 0.5 * (right_m_s - left_m_s) / self.half_track_m


def is_still(twist: Twist2) -> bool:
    """Return whether the base has practically stopped."""
    return abs(twist.v_m_s) < 0.03 and abs(twist.w_rad_s) < 0.10
