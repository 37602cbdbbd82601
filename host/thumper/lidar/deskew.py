"""A scan as points in the frame of the robot, with the motion during the turn taken out."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.numba_kernel import kernel
from thumper.lidar.scan import Scan

INVALID, HIT, MISS = 0, 1, 2  # says nothing; ended on something; saw nothing up to its end

SURE_SHARE = 0.98  # of the sensor's range

KindArray = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanPoints:
    """One row a beam, in the base frame at the time of beam 0."""

    origins_m: FloatArray  # where the laser was, shape (n, 2)
    ends_m: FloatArray  # where the beam ended, shape (n, 2)
    kinds: KindArray  # INVALID, HIT or MISS, shape (n,)

    def hits_m(self) -> FloatArray:
        """The ends of the beams that hit something, shape (m, 2)."""
        return np.ascontiguousarray(self.ends_m[self.kinds == HIT])


def scan_points(scan: Scan, twist: Twist2, base_from_laser: Pose2, usable_range_m: float) -> ScanPoints:
    """De-skew a scan: beam i is seen from where the robot was `i * time_increment_s` after beam 0.

    NaN, ranges outside the sensor's limits and beams without a direction are silent. A beam that went beyond
    `usable_range_m`, or saw nothing (+inf), passed: it proves free space up to there and nothing more. The
    last 2 % of the sensor's own range count as beyond: what it reports there is as often its code for
    "nothing" as a thing.
    """
    usable_range_m = min(usable_range_m, SURE_SHARE * scan.range_max_m)
    origins_m, ends_m, kinds = _points(
        np.ascontiguousarray(scan.ranges_m, dtype=np.float64),
        scan.angle_min_rad,
        scan.angle_increment_rad,
        scan.time_increment_s,
        scan.range_min_m,
        scan.range_max_m,
        usable_range_m,
        twist.v_m_s,
        twist.w_rad_s,
        base_from_laser.x_m,
        base_from_laser.y_m,
        base_from_laser.theta_rad,
    )
    return ScanPoints(origins_m=origins_m, ends_m=ends_m, kinds=kinds)


@kernel
def _points(
    ranges_m: FloatArray,
    angle_min_rad: float,
    angle_increment_rad: float,
    time_increment_s: float,
    range_min_m: float,
    range_max_m: float,
    usable_range_m: float,
    v_m_s: float,
    w_rad_s: float,
    laser_x_m: float,
    laser_y_m: float,
    laser_theta_rad: float,
) -> tuple[FloatArray, FloatArray, KindArray]:
    n = ranges_m.size
    origins_m, ends_m = np.zeros((n, 2)), np.zeros((n, 2))
    kinds = np.zeros(n, dtype=np.uint8)
    for i in range(n):
        range_m = ranges_m[i]
        kind = HIT
        if range_m == math.inf:
            range_m, kind = usable_range_m, MISS
        elif not (range_min_m <= range_m <= range_max_m):  # NaN falls in here too
            continue
        elif range_m > usable_range_m:
            range_m, kind = usable_range_m, MISS
        time_s = i * time_increment_s
        turn_rad = w_rad_s * time_s
        half_rad = 0.5 * turn_rad
        chord_m = v_m_s * time_s * (math.sin(half_rad) / half_rad if half_rad != 0.0 else 1.0)
        cos, sin = math.cos(turn_rad), math.sin(turn_rad)
        x_m = chord_m * math.cos(half_rad) + cos * laser_x_m - sin * laser_y_m
        y_m = chord_m * math.sin(half_rad) + sin * laser_x_m + cos * laser_y_m
        bearing_rad = turn_rad + laser_theta_rad + angle_min_rad + i * angle_increment_rad
        end_x_m, end_y_m = x_m + range_m * math.cos(bearing_rad), y_m + range_m * math.sin(bearing_rad)
        if not (math.isfinite(end_x_m) and math.isfinite(end_y_m)):
            continue
        origins_m[i, 0], origins_m[i, 1] = x_m, y_m
        ends_m[i, 0], ends_m[i, 1] = end_x_m, end_y_m
        kinds[i] = kind
    return origins_m, ends_m, kinds
