"""Averages neighbouring beams that meet the same surface: noise would make every post thicker than it is.

Near the robot twenty beams meet a thin post, and the nearest of twenty noisy ranges lies two standard
deviations before it. Where a gap leaves a few centimetres, that closes it.
"""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.lidar.field_of_view import FieldOfView

REACH_M = 0.012  # along the surface, to each side; short, so that the bend of a thin post hardly counts
MOST_BEAMS = 8  # to each side
SAME_M = 0.04  # a pair whose mean is further off meets something else; four standard deviations of the noise


@kernel
def averaged(bearings_rad: FloatArray, ranges_m: FloatArray) -> FloatArray:
    """Ranges, shape (n,), in the order of the beams, each the mean of itself and of pairs of neighbours.

    The two of a pair lie at the same angle to either side, so that a slanting wall stays where it is. At the
    edge of a thing, and on one that a single beam meets, nothing is changed.
    """
    count = ranges_m.size
    smooth = ranges_m.copy()
    for i in range(count):
        here_m, total_m, taken = ranges_m[i], ranges_m[i], 1
        for k in range(1, min(MOST_BEAMS, i, count - 1 - i) + 1):
            before_rad = abs(bearings_rad[i] - bearings_rad[i - k])
            after_rad = abs(bearings_rad[i + k] - bearings_rad[i])
            widest_rad = max(before_rad, after_rad)
            if widest_rad * here_m > REACH_M or k * abs(after_rad - before_rad) > 0.5 * widest_rad:
                break  # too far along the surface, or a beam between them met nothing
            before_m, after_m = ranges_m[i - k], ranges_m[i + k]
            if abs(0.5 * (before_m + after_m) - here_m) > SAME_M or abs(after_m - before_m) > 2.0 * SAME_M:
                break
            total_m += before_m + after_m
            taken += 2
        smooth[i] = total_m / taken
    return smooth


def averaged_hits(map_from_base: Pose2, hits_in_map_m: FloatArray, view: FieldOfView) -> FloatArray:
    """A scan's hits, shape (n, 2) [m], in the order of their beams, moved along the beams onto the surfaces
    they come from.
    """
    bearings_rad, ranges_m = view.bearings_and_ranges(map_from_base, hits_in_map_m)
    smooth_m = averaged(bearings_rad, ranges_m)
    in_laser_m = np.column_stack((smooth_m * np.cos(bearings_rad), smooth_m * np.sin(bearings_rad)))
    return (map_from_base @ view.base_from_laser).apply(in_laser_m)
