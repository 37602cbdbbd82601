"""The lidar's field of view: mounting pose, opening angle and range. Pure functions."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2


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
        x_m, y_m = (map_from_base @ self.base_from_laser).inverse().apply(points_m).T
        return np.arctan2(y_m, x_m), np.hypot(x_m, y_m)

    def contains(self, bearing_rad: FloatArray, range_m: FloatArray, *, edge_rad: float) -> NDArray[np.bool_]:
        """Return which points, shape (n,), are in view and at least `edge_rad` away from its edges."""
        near: NDArray[np.bool_] = range_m <= self.range_m
        if self.opening_rad >= math.tau - 1e-6:
            return near
        return near & (np.abs(bearing_rad) <= 0.5 * self.opening_rad - edge_rad)
