"""What a map in the making knows of each cell: how often beams ended in it, and how often they crossed it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

CountsArray = NDArray[np.uint8] | NDArray[np.uint16]  # of a map in the making, of a saved one

SEEN = 5  # observations that a cell of a finished map is worth
AGED = 10  # and at most one of another day: else hours of it would outweigh all that has been moved since


@dataclass(frozen=True, slots=True, kw_only=True)
class HitCounts:
    """Hits and misses, both of shape (rows, columns), on the lattice whose cell (0, 0) is at the origin."""

    hits: CountsArray
    misses: CountsArray
    first_cell: tuple[int, int]  # (row, column) of cell [0, 0] on that lattice
    resolution_m: float

    @classmethod
    def from_grid(cls, grid: OccupancyGrid) -> "HitCounts":
        """Counts that say what a finished map says; it is moved by half a cell at most."""
        size_m = grid.resolution_m
        return cls(
            hits=np.where(grid.cells == OCCUPIED, SEEN, 0).astype(np.uint16),
            misses=np.where(grid.cells == FREE, SEEN, 0).astype(np.uint16),
            first_cell=(round(grid.origin_y_m / size_m), round(grid.origin_x_m / size_m)),
            resolution_m=size_m,
        )

    def limit_observations(self, occupied_fraction: float) -> "HitCounts":
        """The same map with at most `AGED` observations a cell, to be changed by what is seen from now on."""
        total = self.hits.astype(np.int32) + self.misses
        share = AGED * (self.hits / np.maximum(total, 1))
        occupied = self.hits >= np.float32(occupied_fraction) * total
        hits = np.where(occupied, np.ceil(share), np.floor(share)).astype(np.uint16)
        old = total > AGED
        return HitCounts(
            hits=np.where(old, hits, self.hits),
            misses=np.where(old, AGED - hits, self.misses),
            first_cell=self.first_cell,
            resolution_m=self.resolution_m,
        )

    def grid(self, occupied_fraction: float) -> OccupancyGrid:
        """The map that they say: a cell of at least this share of hits is occupied."""
        total = self.hits.astype(np.int32) + self.misses
        cells = np.where(total > 0, FREE, UNKNOWN).astype(np.int8)
        cells[(self.hits > 0) & (self.hits >= np.float32(occupied_fraction) * total)] = OCCUPIED
        row, col = self.first_cell
        return OccupancyGrid(
            cells=cells,
            resolution_m=self.resolution_m,
            origin_x_m=col * self.resolution_m,
            origin_y_m=row * self.resolution_m,
        )
