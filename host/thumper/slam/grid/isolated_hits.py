"""Hits that show no wall: their neighbours are far away, as on a corridor's wall far ahead.

The next scan, a little further on, hits the wall a little further on, too. On the map of the scan before, its
nearest hits lie behind by just the way driven, so a match would hold the robot back. In a corridor of 100 m
with a beam per degree it lost 1 m.
"""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT, INVALID, KindArray, ScanPoints

ISOLATED_M = 0.3  # to the hits of the beams before and after


def without_isolated_hits(points: ScanPoints) -> ScanPoints:
    """Return the scan with its isolated hits as invalid beams."""
    kinds = _kinds_without_isolated(points.ends_m, points.kinds)
    return ScanPoints(origins_m=points.origins_m, ends_m=points.ends_m, kinds=kinds)


@kernel
def _kinds_without_isolated(ends_m: FloatArray, kinds: KindArray) -> KindArray:
    (hits,) = np.nonzero(kinds == HIT)
    kept = kinds.copy()
    is_near_last = False
    for k in range(hits.size):
        is_near_next = False
        if k + 1 < hits.size:
            step_x, step_y = ends_m[hits[k + 1]] - ends_m[hits[k]]
            is_near_next = step_x * step_x + step_y * step_y <= ISOLATED_M * ISOLATED_M
        if not (is_near_last or is_near_next):
            kept[hits[k]] = INVALID
        is_near_last = is_near_next
    return kept
