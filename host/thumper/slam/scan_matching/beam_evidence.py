"""What each beam of a scan says about one pose in a map."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import CountArray, DistanceField

# This close before its end, a beam may pass a cell that is a wall in the map: neither is exact.
WALL_MARGIN_M = 0.3
NEW_AREA_BELOW = 0.2  # share of the beams

MaskArray = NDArray[np.bool_]


class BeamEvidence(NamedTuple):
    """What each beam of a scan says about one pose, arrays of shape (n,)."""

    likelihoods: FloatArray  # that it ends on a wall, 0...1
    through_wall: MaskArray  # it crosses a wall more than `WALL_MARGIN_M` before its end
    unknown: MaskArray  # it crosses none, and ends in unknown space away from walls

    @property
    def explained(self) -> float:
        """Share of beams that end on a wall, 0...1.

        One that ends in unknown space does not count, but at least half of the beams are counted.
        """
        return float(self.likelihoods.sum()) / self._counted()

    @property
    def fit(self) -> float:
        """Share of beams that support the pose minus the share against it, -1...1.

        A beam that passes through a wall counts against the pose, whatever it ends on.
        """
        return float(self.likelihoods.sum() - self.through_wall.sum()) / self._counted()

    @property
    def contradicting_share(self) -> float:
        """Share of beams that end in free space, or pass through a wall, 0...1.

        It is near zero for a look through a door into a new room, and large for a kidnapped robot.
        """
        against = self.through_wall | ((self.likelihoods == 0.0) & ~self.unknown)
        return float(against.sum()) / max(1, len(against))

    @property
    def shows_new_area(self) -> bool:
        """Whether hardly a beam contradicts the map: what the map does not explain is new."""
        return self.contradicting_share < NEW_AREA_BELOW

    def _counted(self) -> float:
        beams = len(self.likelihoods)
        return max(1.0, 0.5 * beams, beams - float(self.unknown.sum()))


@kernel
def beam_evidence(
    origins_m: FloatArray,
    ends_m: FloatArray,
    pose: FloatArray,
    field: DistanceField,
    known: MaskArray | CountArray,
    std_m: float,
) -> BeamEvidence:
    """Return the evidence of beams with ends of shape (n, 2) at a pose, shape (3,), from the map's corner.

    `known`, shape (rows, columns), is not 0 where a beam has crossed the cell.
    """
    distance_m, resolution_m = field.distance_m, field.resolution_m
    rows, cols = distance_m.shape
    n = ends_m.shape[0]
    likelihoods = np.empty(n)
    through_wall, unknown = np.empty(n, np.bool_), np.empty(n, np.bool_)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(n):
        along_x, along_y = ends_m[i, 0] - origins_m[i, 0], ends_m[i, 1] - origins_m[i, 1]
        length_m = math.hypot(along_x, along_y)
        through_wall[i] = False
        for k in range(int((length_m - WALL_MARGIN_M) / resolution_m)):
            part = k * resolution_m / length_m
            x_m, y_m = origins_m[i, 0] + part * along_x, origins_m[i, 1] + part * along_y
            col = math.floor((pose[0] + cos * x_m - sin * y_m) / resolution_m)
            row = math.floor((pose[1] + sin * x_m + cos * y_m) / resolution_m)
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] == 0.0:
                through_wall[i] = True
                break
        col = math.floor((pose[0] + cos * ends_m[i, 0] - sin * ends_m[i, 1]) / resolution_m)
        row = math.floor((pose[1] + sin * ends_m[i, 0] + cos * ends_m[i, 1]) / resolution_m)
        inside = 0 <= row < rows and 0 <= col < cols
        near = inside and distance_m[row, col] <= WALL_MARGIN_M
        likelihoods[i] = math.exp(-0.5 * (distance_m[row, col] / std_m) ** 2) if near else 0.0
        unknown[i] = not (through_wall[i] or near or (inside and known[row, col] > 0))
    return BeamEvidence(likelihoods, through_wall, unknown)
