"""Differential-drive kinematics: body twist to wheel speeds and back. Pure functions: no I/O, no clock."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from thumper.common.geometry import Twist2


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveGeometry:
    """Wheel radii, track and encoder resolution. Defaults: Dagu Wild Thumper 6WD.

    `track_m` is the *effective* track. A skid-steered base turns less than the distance between its wheels
    (0.245 m) suggests, because the wheels slip sideways. The calibration measures it with rotations in place
    against the lidar. `wheel_radius_m` is the mean radius of both sides and `radius_ratio` the left radius
    divided by the right one.
    """

    wheel_radius_m: Annotated[float, Gt(0)] = 0.062  # mean radius of both sides
    radius_ratio: Annotated[float, Ge(0.8), Le(1.25)] = 1.0  # left radius divided by the right one
    track_m: Annotated[float, Gt(0)] = 0.3675  # effective track, measured by the calibration
    counts_per_rev: Annotated[int, Gt(0)] = 1200  # encoder counts per wheel revolution

    @property
    def left_radius_m(self) -> float:
        """Radius of the left wheels [m]."""
        return 2.0 * self.wheel_radius_m * self.radius_ratio / (1.0 + self.radius_ratio)

    @property
    def right_radius_m(self) -> float:
        """Radius of the right wheels [m]."""
        return 2.0 * self.wheel_radius_m / (1.0 + self.radius_ratio)

    @property
    def rad_per_count(self) -> float:
        """Rotation of a wheel per encoder count [rad]."""
        return math.tau / self.counts_per_rev


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSpeeds:
    """Angular speeds of the wheels of each side [rad/s]; positive drives forward."""

    left_rad_s: float = 0.0
    right_rad_s: float = 0.0


def wheel_speeds(twist: Twist2, geometry: DriveGeometry) -> WheelSpeeds:
    """Return the wheel speeds of a twist (inverse kinematics): w = (v -/+ omega l/2) / r, left/right."""
    half_m_s = 0.5 * twist.w_rad_s * geometry.track_m
    return WheelSpeeds(
        left_rad_s=(twist.v_m_s - half_m_s) / geometry.left_radius_m,
        right_rad_s=(twist.v_m_s + half_m_s) / geometry.right_radius_m,
    )


def body_twist(speeds: WheelSpeeds, geometry: DriveGeometry) -> Twist2:
    """Return the twist (forward kinematics): v = (rR wR + rL wL)/2, omega = (rR wR - rL wL)/l."""
    left_m_s = geometry.left_radius_m * speeds.left_rad_s
    right_m_s = geometry.right_radius_m * speeds.right_rad_s
    return Twist2(
        v_m_s=0.5 * (right_m_s + left_m_s),
        w_rad_s=(right_m_s - left_m_s) / geometry.track_m,
    )


def limit_wheel_speeds(speeds: WheelSpeeds, limit_rad_s: float) -> WheelSpeeds:
    """Scale both sides by one factor so that neither exceeds the limit; this keeps the curvature."""
    fastest = max(abs(speeds.left_rad_s), abs(speeds.right_rad_s))
    if fastest <= limit_rad_s:
        return speeds
    scale = limit_rad_s / fastest
    return WheelSpeeds(left_rad_s=scale * speeds.left_rad_s, right_rad_s=scale * speeds.right_rad_s)
