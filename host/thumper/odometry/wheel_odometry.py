"""Wheel odometry: encoder counts in, planar pose out. Pure: no I/O, no clock.

SI units. The frame `odom` is the pose of the first sample (x forward, y left); `base` moves with the robot.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.common.kinematics import DriveGeometry


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryOptions:
    """Noise of the odometry; variances grow in proportion to the motion."""

    distance_noise: Annotated[float, Ge(0)] = (
        0.02  # std of the distance after 1 m [m]; grows with the square root of the distance
    )
    turn_noise: Annotated[float, Ge(0)] = 0.05  # std of the heading after a rotation of 1 rad [rad]
    drift_noise: Annotated[float, Ge(0)] = 0.02  # std of the heading after 1 m straight ahead [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySample:
    """Pose, twist and covariance from the wheels."""

    time_s: float
    odom_from_base: Pose2
    twist: Twist2  # mean since the previous sample
    covariance: FloatArray  # of (x, y, theta) in odom, shape (3, 3) [m^2, m rad, rad^2]


def count_delta(old: int, new: int) -> int:
    """Return the signed difference of two int32 readings; exact for fewer than 2**31 counts."""
    return (new - old + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000


def advance(pose: Pose2, arc_m: float, turn_rad: float) -> Pose2:
    """Move along an exact arc that turns by `turn_rad` (Thrun et al., Probabilistic Robotics, 5.3)."""
    half_rad = 0.5 * turn_rad
    chord_m = arc_m * (math.sin(half_rad) / half_rad if half_rad else 1.0)
    heading_rad = pose.theta_rad + half_rad
    return Pose2(
        x_m=pose.x_m + chord_m * math.cos(heading_rad),
        y_m=pose.y_m + chord_m * math.sin(heading_rad),
        theta_rad=wrap_angle(pose.theta_rad + turn_rad),
    )


class WheelOdometry:
    """Accumulates encoder counts into `odom_from_base`."""

    def __init__(self, geometry: DriveGeometry, options: OdometryOptions | None = None) -> None:
        self._geometry = geometry
        self._options = options or OdometryOptions()
        self._counts: tuple[int, int] | None = None
        self._last = OdometrySample(
            time_s=0.0, odom_from_base=Pose2(), twist=Twist2(), covariance=np.zeros((3, 3))
        )

    def update(self, time_s: float, left_count: int, right_count: int) -> OdometrySample:
        """Add one reading of both encoders (int32, may wrap); the first one defines the origin.

        A reading whose stamp is not later than the previous one still moves the pose, because the counts are
        exact. It leaves the twist unchanged, because a speed needs a time.
        """
        last = self._last
        if self._counts is None:
            left_m = right_m = 0.0
        else:
            left_rad = count_delta(self._counts[0], left_count) * self._geometry.rad_per_count
            right_rad = count_delta(self._counts[1], right_count) * self._geometry.rad_per_count
            left_m = left_rad * self._geometry.left_radius_m
            right_m = right_rad * self._geometry.right_radius_m
        arc_m = 0.5 * (left_m + right_m)
        turn_rad = (right_m - left_m) / self._geometry.track_m
        dt_s = time_s - last.time_s
        twist = last.twist
        if self._counts is not None and dt_s > 0.0:
            twist = Twist2(v_m_s=arc_m / dt_s, w_rad_s=turn_rad / dt_s)
        self._counts = (left_count, right_count)
        self._last = OdometrySample(
            time_s=time_s,
            odom_from_base=advance(last.odom_from_base, arc_m, turn_rad),
            twist=twist,
            covariance=self._propagate(last.covariance, last.odom_from_base, arc_m, turn_rad),
        )
        return self._last

    def _propagate(self, covariance: FloatArray, pose: Pose2, arc_m: float, turn_rad: float) -> FloatArray:
        """Propagate the covariance to first order, P' = F P F^T + G Q G^T, on the chord of the arc."""
        heading_rad = pose.theta_rad + 0.5 * turn_rad
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        pose_jacobian = np.array([[1.0, 0.0, -arc_m * sin], [0.0, 1.0, arc_m * cos], [0.0, 0.0, 1.0]])
        motion_jacobian = np.array([[cos, -0.5 * arc_m * sin], [sin, 0.5 * arc_m * cos], [0.0, 1.0]])
        noise = np.diag(
            [
                self._options.distance_noise**2 * abs(arc_m),
                self._options.turn_noise**2 * abs(turn_rad) + self._options.drift_noise**2 * abs(arc_m),
            ]
        )
        return np.asarray(
            pose_jacobian @ covariance @ pose_jacobian.T + motion_jacobian @ noise @ motion_jacobian.T
        )
