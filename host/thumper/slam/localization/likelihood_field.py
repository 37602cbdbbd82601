"""A known map as a distance field."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.grid.branch_and_bound import BranchAndBoundSearch, SearchField
from thumper.slam.scan_matching.distance_field import DistanceField, FieldArray

SEARCH_STD_M = 0.15


class LikelihoodField:
    """Distances to the walls of a fixed map."""

    def __init__(self, grid: OccupancyGrid, max_distance_m: float) -> None:
        """Cut the distances off at `max_distance_m`."""
        from scipy.ndimage import distance_transform_edt  # 25 MB that mapping never needs

        self.grid = grid
        # The map may end at its walls, but the space near them must be covered, too.
        edge = math.ceil(max_distance_m / grid.resolution_m)
        padded = np.pad(grid.cells, edge, constant_values=UNKNOWN)
        occupied = padded == OCCUPIED
        cells = distance_transform_edt(~occupied) if occupied.any() else np.full(occupied.shape, np.inf)
        distance_m: FieldArray = np.minimum(cells * grid.resolution_m, max_distance_m).astype(np.float32)
        self.field = DistanceField(distance_m, grid.resolution_m, float(np.float32(max_distance_m)))
        self.known = padded != UNKNOWN
        self.corner_m = np.array([grid.origin_x_m, grid.origin_y_m]) - edge * grid.resolution_m
        self._free: NDArray[np.int64] = np.argwhere(padded == FREE)

    def to_corner(self, poses: FloatArray) -> FloatArray:
        """Return map poses, shape (n, 3), in metres from the corner of the field's first cell."""
        moved = poses.copy()
        moved[..., :2] -= self.corner_m
        return moved

    def from_corner(self, poses: FloatArray) -> FloatArray:
        """Invert `to_corner`."""
        moved = poses.copy()
        moved[..., :2] += self.corner_m
        return moved

    def random_poses(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw poses evenly from the free space, shape (count, 3)."""
        distance_m = self.field.distance_m
        cells = self._free if len(self._free) else np.argwhere(np.ones_like(distance_m, dtype=np.bool_))
        rows_cols = cells[rng.integers(len(cells), size=count)] + rng.random((count, 2))
        xy_m = rows_cols[:, ::-1] * self.grid.resolution_m + self.corner_m
        return np.column_stack((xy_m, rng.uniform(-np.pi, np.pi, count)))

    def similar_poses(self, hits_m: FloatArray, max_poses: int, min_ratio: float) -> FloatArray:
        """Return the pose that explains the scan best, and separate ones that explain `min_ratio` as much.

        Searches the whole map; shape (1...max_poses, 3).
        """
        rows, cols = self.field.distance_m.shape
        half_m = 0.5 * self.grid.resolution_m * np.array([cols, rows])
        x_m, y_m = (float(value) for value in self.corner_m + half_m)
        search = BranchAndBoundSearch(
            self._search_field(),
            hits_m,
            Pose2(x_m=x_m, y_m=y_m),
            float(half_m.max()),
            math.pi,
            max_poses=max_poses,
            min_ratio=min_ratio,
        )
        search.run(None)
        return search.similar_poses()

    def _search_field(self) -> SearchField:
        corner = (float(self.corner_m[0]), float(self.corner_m[1]))
        return SearchField(self.field.distance_m, self.grid.resolution_m, corner, SEARCH_STD_M)
