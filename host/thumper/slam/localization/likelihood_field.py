"""A known map as a distance field."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, bands_of, run_to_end
from thumper.maps.distance_transform import squared_distances
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.grid.branch_and_bound import BranchAndBoundSearch, SearchField
from thumper.slam.scan_matching.distance_field import DistanceField

MAX_DISTANCE_M = 0.5  # cut-off of the distances
SEARCH_STD_M = 0.15
LOOKUPS_PER_SLICE = 20_000_000  # of a cell: about 15 ms


class LikelihoodField:
    """Distances to the walls of a fixed map, cut off at `MAX_DISTANCE_M`."""

    def __init__(self, grid: OccupancyGrid) -> None:
        """Process the whole map at once."""
        run_to_end(self._process(grid))

    @classmethod
    def search(cls, grid: OccupancyGrid) -> Search["LikelihoodField"]:
        """Process the map one band in each slice; it must not change until the end."""
        field = cls.__new__(cls)
        yield from field._process(grid)
        return field

    def _process(self, grid: OccupancyGrid) -> Search[None]:
        self.grid = grid
        # The map may end at its walls, but the space near them must be covered, too.
        edge = math.ceil(MAX_DISTANCE_M / grid.resolution_m)
        padded = np.pad(grid.cells, edge, constant_values=UNKNOWN)
        distance_m = np.empty(padded.shape, np.float32)
        free = []
        for rows in bands_of(padded.shape):
            top = max(0, rows.start - edge)
            squared = squared_distances(padded[top : rows.stop + edge] == OCCUPIED, edge)
            cells = np.sqrt(squared[rows.start - top : rows.stop - top])
            distance_m[rows] = np.minimum(cells * grid.resolution_m, MAX_DISTANCE_M)
            free.append(
                (np.flatnonzero(padded[rows] == FREE) + rows.start * padded.shape[1]).astype(np.int32)
            )
            yield
        self._free: NDArray[np.int64] = np.concatenate(free)  # flat indices
        self.field = DistanceField(distance_m, grid.resolution_m, float(np.float32(MAX_DISTANCE_M)))
        self.known = padded != UNKNOWN
        self.corner_m = np.array([grid.origin_x_m, grid.origin_y_m]) - edge * grid.resolution_m
        corner = (float(self.corner_m[0]), float(self.corner_m[1]))
        self._search_field = yield from SearchField.search(
            distance_m, self.field.max_distance_m, grid.resolution_m, corner, SEARCH_STD_M
        )

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
        rows, cols = self.field.distance_m.shape
        if len(self._free):
            cells = self._free[rng.integers(len(self._free), size=count)]
        else:
            cells = rng.integers(rows * cols, size=count)
        rows_cols = np.stack(np.divmod(cells, cols), axis=1) + rng.random((count, 2))
        xy_m = rows_cols[:, ::-1] * self.grid.resolution_m + self.corner_m
        return np.column_stack((xy_m, rng.uniform(-np.pi, np.pi, count)))

    def search_poses(self, hits_m: FloatArray, max_poses: int, min_ratio: float) -> Search[FloatArray]:
        """Return the pose that explains the scan best, and separate ones that explain `min_ratio` as much.

        Searches the whole map; shape (1...max_poses, 3).
        """
        rows, cols = self.field.distance_m.shape
        half_m = 0.5 * self.grid.resolution_m * np.array([cols, rows])
        x_m, y_m = (float(value) for value in self.corner_m + half_m)
        search = BranchAndBoundSearch(
            self._search_field,
            hits_m,
            Pose2(x_m=x_m, y_m=y_m),
            (float(half_m[0]), float(half_m[1])),
            math.pi,
            max_poses=max_poses,
            min_ratio=min_ratio,
        )
        at_once = search.lookups <= LOOKUPS_PER_SLICE
        while not search.run(None if at_once else LOOKUPS_PER_SLICE):
            yield
        return search.similar_poses()
