"""How much of what two scans in a row show is the same."""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2

TOLERANCE_M, TOLERANCE_PER_M = 0.05, 0.03  # between a point and the other scan; beams diverge with the range
COMPARED_POINTS = 150  # of each scan, about


def shared_view(old_m: FloatArray, new_m: FloatArray, old_from_new: Pose2) -> float:
    """Return the share of points that lie near the other scan, 0...1: the smaller one of the two scans'.

    Hits of shape (n, 2), each in its base frame. With the true motion it was above 0.45 in 98 % of the steps
    of up to 0.3 m in six recorded logs; between different places it was below 0.29 in 99 %.
    """
    if not len(old_m) or not len(new_m):
        return 0.0
    moved_m = old_from_new.apply(new_m)
    return min(_near_share(moved_m, new_m, old_m), _near_share(old_m, old_m, moved_m))


def _near_share(points_m: FloatArray, beams_m: FloatArray, others_m: FloatArray) -> float:
    """Return the share of points near one of the others; `beams_m` are the points seen from the robot."""
    thinned = slice(None, None, max(1, len(points_m) // COMPARED_POINTS))
    points_m, beams_m = points_m[thinned], beams_m[thinned]
    apart_m = np.hypot(*(points_m[:, np.newaxis] - others_m[np.newaxis]).transpose(2, 0, 1)).min(axis=1)
    tolerance_m = TOLERANCE_M + TOLERANCE_PER_M * np.hypot(beams_m[:, 0], beams_m[:, 1])
    return float(np.mean(apart_m <= tolerance_m))
