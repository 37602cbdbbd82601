"""Drop echoes of the robot itself: cables, masts and tyres beside the lidar are no obstacles. Pure."""

from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scan import Scan

MARGIN_M = 0.03
"""The footprint is made smaller by this: the error of a URG-04LX up to 1 m (data sheet)."""


class SelfReturnFilter:
    """Marks the beams that end inside the robot's footprint as invalid: nothing else can be there."""

    def __init__(self, base_from_laser: Pose2, polygon_m: FloatArray) -> None:
        """Set up for a convex footprint in base_link, shape (k, 2), counter-clockwise."""
        self._base_from_laser = base_from_laser
        self._polygon_m = polygon_m
        edges_m = np.roll(polygon_m, -1, axis=0) - polygon_m
        self._inward = np.column_stack([-edges_m[:, 1], edges_m[:, 0]]) / np.hypot(*edges_m.T)[:, None]
        laser_m = np.array([base_from_laser.x_m, base_from_laser.y_m])
        self._reach_m = float(np.hypot(*(polygon_m - laser_m).T).max())

    def filter(self, scan: Scan) -> Scan:
        """Return the scan with NaN for the beams that end inside the footprint."""
        near = np.flatnonzero(scan.ranges_m < self._reach_m)
        if not near.size:
            return scan
        angles_rad = scan.angles_rad()[near]
        ends_m = scan.ranges_m[near, None] * np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
        from_corners_m = self._base_from_laser.apply(ends_m)[:, None, :] - self._polygon_m
        inside_m = np.sum(from_corners_m * self._inward, axis=2)
        own = near[(inside_m > MARGIN_M).all(axis=1)]
        if not own.size:
            return scan
        ranges_m = scan.ranges_m.copy()
        ranges_m[own] = np.nan
        return replace(scan, ranges_m=ranges_m)
