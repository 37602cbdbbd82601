"""The lidar's field of view: mounting pose, opening angle and range. Pure functions."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOfView:
    """Field of view, symmetric about the lidar's x axis. Defaults: the URG-04LX on the Wild Thumper."""

    base_from_laser: Pose2 = field(default_factory=lambda: Pose2(x_m=0.12))
    opening_rad: float = math.radians(240.0)
    range_m: float = 4.0

    def bearings_and_ranges(
        self, map_from_base: Pose2, points_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return bearing [rad] and range [m], from the lidar, of points in `map`, shape (n, 2)."""
        laser = map_from_base @ self.base_from_laser
        return _bearings_and_ranges(points_m, laser.x_m, laser.y_m, laser.theta_rad)

    def contains(self, bearing_rad: FloatArray, range_m: FloatArray, *, edge_rad: float) -> NDArray[np.bool_]:
        """Return which points, shape (n,), are in view and at least `edge_rad` away from its edges."""
        near: NDArray[np.bool_] = range_m <= self.range_m
        if self.opening_rad >= math.tau - 1e-6:
            return near
        return near & (np.abs(bearing_rad) <= 0.5 * self.opening_rad - edge_rad)


@kernel
def _bearings_and_ranges(
    points_m: FloatArray, laser_x_m: float, laser_y_m: float, laser_theta_rad: float
) -> tuple[FloatArray, FloatArray]:
    cos, sin = math.cos(laser_theta_rad), math.sin(laser_theta_rad)
    bearing_rad, range_m = np.empty(len(points_m)), np.empty(len(points_m))
    for k in range(len(points_m)):
        dx_m, dy_m = points_m[k, 0] - laser_x_m, points_m[k, 1] - laser_y_m
        ahead_m, left_m = cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m
        bearing_rad[k], range_m[k] = math.atan2(left_m, ahead_m), math.hypot(ahead_m, left_m)
    return bearing_rad, range_m
