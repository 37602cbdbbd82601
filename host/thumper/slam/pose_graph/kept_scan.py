"""The scans that a pose graph keeps, to rebuild its map and to find loops."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT, INVALID, KindArray, ScanPoints

SingleArray = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeScan:
    """An inserted scan, in single precision: a long drive keeps thousands."""

    submap: int
    submap_from_base: Pose2
    origins_m: NDArray[np.float32]  # shape (n, 2), or (1, 2) if the robot was stationary during the scan
    ends_m: NDArray[np.float32]
    kinds: KindArray

    def points(self, range_m: float = math.inf) -> ScanPoints:
        """Return the valid beams; those longer than `range_m` are invalid."""
        origins_m = np.broadcast_to(self.origins_m, self.ends_m.shape).astype(np.float64, order="C")
        kinds = self.kinds
        if range_m < math.inf:
            along_m = self.ends_m - self.origins_m
            kinds = np.where(np.hypot(along_m[:, 0], along_m[:, 1]) <= range_m, kinds, np.uint8(INVALID))
        return ScanPoints(origins_m=origins_m, ends_m=self.ends_m.astype(np.float64, order="C"), kinds=kinds)

    def thinned_hits_m(self, map_from_base: Pose2, count: float) -> FloatArray:
        """Return about `count` of the hits in the map, for a pose of the robot there, shape (n, 2)."""
        (hits,) = (self.kinds == HIT).nonzero()
        thinned = hits[:: max(1, int(hits.size / count))]
        return map_from_base.apply(self.ends_m.take(thinned, axis=0).astype(np.float64))


def keep_scan(submap: int, submap_from_base: Pose2, points: ScanPoints) -> NodeScan:
    """Return the valid beams of a scan."""
    origins_m, ends_m, kinds = _valid_beams(points.origins_m, points.ends_m, points.kinds)
    return NodeScan(
        submap=submap, submap_from_base=submap_from_base, origins_m=origins_m, ends_m=ends_m, kinds=kinds
    )


@kernel
def _valid_beams(
    origins_m: FloatArray, ends_m: FloatArray, kinds: KindArray
) -> tuple[SingleArray, SingleArray, KindArray]:
    valid = np.flatnonzero(kinds != INVALID)
    origins, ends = np.empty((valid.size, 2), np.float32), np.empty((valid.size, 2), np.float32)
    is_stationary = True
    for k in range(valid.size):
        i = valid[k]
        origins[k, 0], origins[k, 1] = origins_m[i, 0], origins_m[i, 1]
        ends[k, 0], ends[k, 1] = ends_m[i, 0], ends_m[i, 1]
        is_stationary &= origins[k, 0] == origins[0, 0] and origins[k, 1] == origins[0, 1]
    return (origins[:1].copy() if is_stationary else origins), ends, kinds[valid]
