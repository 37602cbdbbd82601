"""Planar poses and twists. SI units, REP-103: x forward, y left, counter-clockwise positive.

A pose that serves as a transform is named `target_from_source`, so that neighbours cancel:
`map_from_base = map_from_odom @ odom_from_base`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.attribute_hints import HintedAttributes

FloatArray = NDArray[np.float64]


def wrap_angle(angle_rad: float) -> float:
    """Return the angle wrapped to [-pi, pi]."""
    return math.remainder(angle_rad, math.tau)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Pose2(HintedAttributes):
    """A pose in the plane. As a transform it maps points from the body's frame to the pose's frame."""

    x_m: float = 0.0  # forward, at the start
    y_m: float = 0.0  # to the left, at the start
    theta_rad: float = 0.0  # counter-clockwise from x

    @property
    def heading_deg(self) -> float:
        """The heading `theta_rad` in degrees."""
        return math.degrees(self.theta_rad)

    def __repr__(self) -> str:
        return f"Pose2({self.x_m:z.2f} m, {self.y_m:z.2f} m, {self.heading_deg:z.1f}°)"

    def __matmul__(self, other: "Pose2") -> "Pose2":
        """Compose: `a_from_b @ b_from_c` is `a_from_c`."""
        cos, sin = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose2(
            x_m=self.x_m + cos * other.x_m - sin * other.y_m,
            y_m=self.y_m + sin * other.x_m + cos * other.y_m,
            theta_rad=wrap_angle(self.theta_rad + other.theta_rad),
        )

    def inverse(self) -> "Pose2":
        """Return `b_from_a` for `a_from_b`."""
        cos, sin = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose2(
            x_m=-cos * self.x_m - sin * self.y_m,
            y_m=sin * self.x_m - cos * self.y_m,
            theta_rad=wrap_angle(-self.theta_rad),
        )

    def apply(self, points_m: FloatArray) -> FloatArray:
        """Return points, shape (n, 2) [m], transformed from the source frame to the target frame."""
        cos, sin = math.cos(self.theta_rad), math.sin(self.theta_rad)
        rotation = np.array([[cos, sin], [-sin, cos]])
        return np.asarray(points_m @ rotation + (self.x_m, self.y_m), dtype=np.float64)

    def distance_m(self, other: "Pose2") -> float:
        """Return the Euclidean distance between the two origins [m]."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Twist2:
    """Velocity of a differential-drive body: forward [m/s] and counter-clockwise [rad/s]."""

    v_m_s: float = 0.0
    w_rad_s: float = 0.0

    def __repr__(self) -> str:
        return f"Twist2({self.v_m_s:z.2f} m/s, {self.w_rad_s:z.2f} rad/s)"
