"""Average neighbouring beams that hit the same surface; noise would make every post thicker.

Near the robot twenty beams hit a thin post, and the nearest of twenty noisy ranges is two standard deviations
in front of it. In a gap with a few centimetres to spare, that closes the gap.
"""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.lidar.field_of_view import FieldOfView

HALF_WIDTH_M = 0.012  # along the surface, to each side; short, so that a thin post's curvature hardly counts
MAX_BEAMS = 8  # to each side
# A pair whose mean differs by more hits something else; four standard deviations of the noise.
SAME_SURFACE_M = 0.04
CONFIRMED_M = 0.08


@kernel
def average_ranges(bearings_rad: FloatArray, ranges_m: FloatArray) -> FloatArray:
    """Average each range, shape (n,), in beam order, with pairs of neighbours.

    The two beams of a pair are at the same angle to either side, so a slanted wall stays in place. Nothing
    changes at the edge of an object or on one that a single beam hits.
    """
    count = ranges_m.size
    smooth = ranges_m.copy()
    for i in range(count):
        here_m, total_m, taken = ranges_m[i], ranges_m[i], 1
        for k in range(1, min(MAX_BEAMS, i, count - 1 - i) + 1):
            before_rad = abs(bearings_rad[i] - bearings_rad[i - k])
            after_rad = abs(bearings_rad[i + k] - bearings_rad[i])
            widest_rad = max(before_rad, after_rad)
            if widest_rad * here_m > HALF_WIDTH_M or k * abs(after_rad - before_rad) > 0.5 * widest_rad:
                break  # too far along the surface, or a beam in between hit nothing
            before_m, after_m = ranges_m[i - k], ranges_m[i + k]
            differs = abs(0.5 * (before_m + after_m) - here_m) > SAME_SURFACE_M
            if differs or abs(after_m - before_m) > 2.0 * SAME_SURFACE_M:
                break
            total_m += before_m + after_m
            taken += 2
        smooth[i] = total_m / taken
    return smooth


def confirmed_hits(hits_m: FloatArray) -> NDArray[np.bool_]:
    """Return which hits, shape (n, 2) [m], are within `CONFIRMED_M` of a neighbour in beam order, shape (n,).

    A beam that meets an edge measures a point in the air behind it, at another range in every scan. A hit
    alone is such a mixed pixel, or an object so thin or so far that a single beam meets it.
    """
    beside: NDArray[np.bool_] = np.hypot(*np.diff(hits_m, axis=0).T) < CONFIRMED_M
    confirmed = np.zeros(len(hits_m), np.bool_)
    confirmed[1:] |= beside
    confirmed[:-1] |= beside
    return confirmed


def averaged_hits(map_from_base: Pose2, hits_in_map_m: FloatArray, view: FieldOfView) -> FloatArray:
    """Return a scan's hits, shape (n, 2) [m], in beam order, with their ranges averaged by surface."""
    bearings_rad, ranges_m = view.bearings_and_ranges(map_from_base, hits_in_map_m)
    smooth_m = average_ranges(bearings_rad, ranges_m)
    in_laser_m = np.column_stack((smooth_m * np.cos(bearings_rad), smooth_m * np.sin(bearings_rad)))
    return (map_from_base @ view.base_from_laser).apply(in_laser_m)
