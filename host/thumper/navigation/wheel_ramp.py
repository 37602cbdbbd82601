"""What the board does to a change of speed: it ramps each wheel by itself, so the base neither brakes nor
turns at one rate.

Told to stop in a bend, both sides slow alike; the inner one stands first, and the robot swings inward round
it. A model that lets v and w fade on their own does not see that swing.
"""

from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray, Twist2
from thumper.kinematics import DriveGeometry
from thumper.navigation.limits import SpeedLimits


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
