"""Convert a scan to points in the robot's frame, corrected for the motion during the revolution."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.numba_kernel import kernel
from thumper.lidar.scan import Scan

INVALID, HIT, MISS = 0, 1, 2  # no information; ended on an obstacle; saw nothing up to its end

RELIABLE_SHARE = 0.98  # of the sensor's range

KindArray = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class ScanPoints:
    """One row per beam, in the base frame at the time of beam 0."""

    origins_m: FloatArray  # position of the laser, shape (n, 2)
    ends_m: FloatArray  # end of the beam, shape (n, 2)
    kinds: KindArray  # INVALID, HIT or MISS, shape (n,)

    @cached_property
    def hits_m(self) -> FloatArray:
        """The end points of the beams that hit something, shape (m, 2)."""
        return np.ascontiguousarray(self.ends_m.compress(self.kinds == HIT, axis=0))

    def length_m(self) -> float:
        """Return the length of all valid beams together."""
        along_m = (self.ends_m - self.origins_m)[self.kinds != INVALID]
        return float(np.hypot(along_m[:, 0], along_m[:, 1]).sum())


class _Beams(NamedTuple):
    """Ranges, shape (n,), and geometry of a scan, for the kernel."""

    ranges_m: FloatArray
    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float
    range_min_m: float
    range_max_m: float
    usable_range_m: float


class _Motion(NamedTuple):
    """Twist of the robot and pose of the laser in the base frame, for the kernel."""

    v_m_s: float
    w_rad_s: float
    laser_x_m: float
    laser_y_m: float
    laser_theta_rad: float


def scan_points(scan: Scan, twist: Twist2, base_from_laser: Pose2, usable_range_m: float) -> ScanPoints:
    """De-skew a scan: beam i is measured at the robot's pose `i * time_increment_s` after beam 0.

    NaN, ranges outside the sensor's limits and beams without a direction are INVALID. A beam longer than
    `usable_range_m`, or without a return (+inf), is a MISS: it proves free space up to that range and nothing
    more. So is one in the last 2 % of the sensor's own range, where sensors report "no return" as often as an
    obstacle.
    """
    beams = _Beams(
        ranges_m=np.ascontiguousarray(scan.ranges_m, dtype=np.float64),
        angle_min_rad=float(scan.angle_min_rad),
        angle_increment_rad=float(scan.angle_increment_rad),
        time_increment_s=float(scan.time_increment_s),
        range_min_m=float(scan.range_min_m),
        range_max_m=float(scan.range_max_m),
        usable_range_m=float(min(usable_range_m, RELIABLE_SHARE * scan.range_max_m)),
    )
    motion = _Motion(
        v_m_s=float(twist.v_m_s),
        w_rad_s=float(twist.w_rad_s),
        laser_x_m=float(base_from_laser.x_m),
        laser_y_m=float(base_from_laser.y_m),
        laser_theta_rad=float(base_from_laser.theta_rad),
    )
    origins_m, ends_m, kinds = _deskew(beams, motion)
    return ScanPoints(origins_m=origins_m, ends_m=ends_m, kinds=kinds)


@kernel
def _deskew(beams: _Beams, motion: _Motion) -> tuple[FloatArray, FloatArray, KindArray]:
    n = beams.ranges_m.size
    origins_m, ends_m = np.zeros((n, 2)), np.zeros((n, 2))
    kinds = np.zeros(n, dtype=np.uint8)
    for i in range(n):
        range_m = beams.ranges_m[i]
        kind = HIT
        if range_m == math.inf:
            range_m, kind = beams.usable_range_m, MISS
        elif not (beams.range_min_m <= range_m <= beams.range_max_m):  # also true for NaN
            continue
        elif range_m > beams.usable_range_m:
            range_m, kind = beams.usable_range_m, MISS
        time_s = i * beams.time_increment_s
        turn_rad = motion.w_rad_s * time_s
        half_rad = 0.5 * turn_rad
        chord_m = motion.v_m_s * time_s * (math.sin(half_rad) / half_rad if half_rad != 0.0 else 1.0)
        cos, sin = math.cos(turn_rad), math.sin(turn_rad)
        x_m = chord_m * math.cos(half_rad) + cos * motion.laser_x_m - sin * motion.laser_y_m
        y_m = chord_m * math.sin(half_rad) + sin * motion.laser_x_m + cos * motion.laser_y_m
        bearing_rad = turn_rad + motion.laser_theta_rad + beams.angle_min_rad + i * beams.angle_increment_rad
        end_x_m, end_y_m = x_m + range_m * math.cos(bearing_rad), y_m + range_m * math.sin(bearing_rad)
        if not (math.isfinite(end_x_m) and math.isfinite(end_y_m)):
            continue
        origins_m[i, 0], origins_m[i, 1] = x_m, y_m
        ends_m[i, 0], ends_m[i, 1] = end_x_m, end_y_m
        kinds[i] = kind
    return origins_m, ends_m, kinds
