"""Differential-drive kinematics: body twist to wheel speeds and back. Pure: no I/O, no clock."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt

from thumper.geometry import Twist2


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveGeometry:
    """What the wheels do to the body. Defaults: Dagu Wild Thumper 6WD.

    `track_m` is the *effective* track: a skid-steered base turns less than the distance between its wheels
    says (0.245 m), because the wheels slip sideways; turning on the spot against the lidar calibrates it.
    """

    wheel_radius_m: Annotated[float, Gt(0)] = 0.062
    track_m: Annotated[float, Gt(0)] = 0.3675
    counts_per_rev: Annotated[int, Gt(0)] = 1200

    @property
    def m_per_count(self) -> float:
        """Wheel travel per encoder count [m]."""
        return math.tau * self.wheel_radius_m / self.counts_per_rev


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSpeeds:
    """Angular speeds of the wheels of each side [rad/s]; positive drives forward."""

    left_rad_s: float = 0.0
    right_rad_s: float = 0.0


def wheel_speeds(twist: Twist2, geometry: DriveGeometry) -> WheelSpeeds:
    """Inverse kinematics: w = (v -/+ omega l/2) / r for left/right."""
    half_m_s = 0.5 * twist.w_rad_s * geometry.track_m
    return WheelSpeeds(
        left_rad_s=(twist.v_m_s - half_m_s) / geometry.wheel_radius_m,
        right_rad_s=(twist.v_m_s + half_m_s) / geometry.wheel_radius_m,
    )


def body_twist(speeds: WheelSpeeds, geometry: DriveGeometry) -> Twist2:
    """Forward kinematics: v = r (wR + wL)/2, omega = r (wR - wL)/l."""
    return Twist2(
        v_m_s=0.5 * geometry.wheel_radius_m * (speeds.right_rad_s + speeds.left_rad_s),
        w_rad_s=geometry.wheel_radius_m * (speeds.right_rad_s - speeds.left_rad_s) / geometry.track_m,
    )


def limit_wheel_speeds(speeds: WheelSpeeds, limit_rad_s: float) -> WheelSpeeds:
    """Scale both sides by the same factor so that neither exceeds the limit: the curvature is kept."""
    fastest = max(abs(speeds.left_rad_s), abs(speeds.right_rad_s))
    if fastest <= limit_rad_s:
        return speeds
    scale = limit_rad_s / fastest
    return WheelSpeeds(left_rad_s=scale * speeds.left_rad_s, right_rad_s=scale * speeds.right_rad_s)
