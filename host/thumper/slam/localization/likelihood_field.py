"""A known map as a distance field: what a scan should look like from anywhere in it."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.grid.branch_and_bound import SearchField
from thumper.slam.scan_matching.distance_field import FieldArray

SEARCH_STD_M = 0.15


class LikelihoodField:
    """Distances to the walls of a map that does not change."""

    def __init__(self, grid: OccupancyGrid, reach_m: float) -> None:
        """Cut the distances off at `reach_m`."""
        from scipy.ndimage import distance_transform_edt  # 25 MB that mapping never needs

        self.grid = grid
        edge = math.ceil(reach_m / grid.resolution_m)  # a map may end at its walls, but not what is near them
        padded = np.pad(grid.cells, edge, constant_values=UNKNOWN)
        occupied = padded == OCCUPIED
        cells = distance_transform_edt(~occupied) if occupied.any() else np.full(occupied.shape, np.inf)
        self.distance_m: FieldArray = np.minimum(cells * grid.resolution_m, reach_m).astype(np.float32)
        self.known = padded != UNKNOWN
        self.reach_m = float(np.float32(reach_m))
        self.corner_m = np.array([grid.origin_x_m, grid.origin_y_m]) - edge * grid.resolution_m
        self._free: NDArray[np.int64] = np.argwhere(padded == FREE)

    def to_corner(self, poses: FloatArray) -> FloatArray:
        """Poses, shape (n, 3), in metres from the corner of the field's first cell."""
        moved = poses.copy()
        moved[..., :2] -= self.corner_m
        return moved

    def from_corner(self, poses: FloatArray) -> FloatArray:
        """The inverse of `to_corner`."""
        moved = poses.copy()
        moved[..., :2] += self.corner_m
        return moved

    def anywhere(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Poses drawn evenly from the free space, shape (count, 3)."""
        cells = self._free if len(self._free) else np.argwhere(np.ones_like(self.distance_m, dtype=np.bool_))
        rows_cols = cells[rng.integers(len(cells), size=count)] + rng.random((count, 2))
        xy_m = rows_cols[:, ::-1] * self.grid.resolution_m + self.corner_m
        return np.column_stack((xy_m, rng.uniform(-np.pi, np.pi, count)))

    def alike(self, hits_m: FloatArray, most: int, ratio: float) -> FloatArray:
        """Poses of the whole map that explain the scan best, and nearly as well; shape (1...most, 3)."""
        rows, cols = self.distance_m.shape
        half_m = 0.5 * self.grid.resolution_m * np.array([cols, rows])
        x_m, y_m = (float(value) for value in self.corner_m + half_m)
        return self._search_field().search_all(
            hits_m, Pose2(x_m=x_m, y_m=y_m), float(half_m.max()), math.pi, most, ratio
        )

    def _search_field(self) -> SearchField:
        corner = (float(self.corner_m[0]), float(self.corner_m[1]))
        return SearchField(self.distance_m, self.grid.resolution_m, corner, SEARCH_STD_M)
