"""Hits and misses per cell: how many beams ended in it, and how many crossed it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

CountsArray = NDArray[np.uint8] | NDArray[np.uint16]  # of a map that is being built, of a saved one

FINISHED_MAP_OBSERVATIONS = 5  # weight of a cell of a finished map
# Weight limit of a saved map. Hours of old observations would outweigh everything that has moved since.
MAX_OBSERVATIONS = 10
# A cell with at most this share of the hits of another cell within `STRAY_CELLS` holds noise.
STRAY_SHARE, STRAY_CELLS = 0.2, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class HitCounts:
    """Hits and misses, both of shape (rows, columns), on a lattice with cell (0, 0) at the origin."""

    hits: CountsArray
    misses: CountsArray
    first_cell: tuple[int, int]  # (row, column) of cell [0, 0] on that lattice
    resolution_m: float

    @classmethod
    def from_grid(cls, grid: OccupancyGrid) -> "HitCounts":
        """Return counts that give the same map; snapping to the lattice moves it by half a cell at most."""
        size_m = grid.resolution_m
        return cls(
            hits=np.where(grid.cells == OCCUPIED, FINISHED_MAP_OBSERVATIONS, 0).astype(np.uint16),
            misses=np.where(grid.cells == FREE, FINISHED_MAP_OBSERVATIONS, 0).astype(np.uint16),
            first_cell=(round(grid.origin_y_m / size_m), round(grid.origin_x_m / size_m)),
            resolution_m=size_m,
        )

    def limit_observations(self, occupied_fraction: float) -> "HitCounts":
        """Return the same map with at most `MAX_OBSERVATIONS` per cell, so that new scans can change it."""
        old = np.nonzero(self.hits.astype(np.int32) + self.misses > MAX_OBSERVATIONS)
        hits, misses = self.hits.astype(np.uint16), self.misses.astype(np.uint16)
        old_hits = hits[old].astype(np.int32)
        total = old_hits + misses[old]
        share = MAX_OBSERVATIONS * (old_hits / total)
        occupied = old_hits >= np.float32(occupied_fraction) * total
        hits[old] = np.where(occupied, np.ceil(share), np.floor(share))
        misses[old] = MAX_OBSERVATIONS - hits[old]
        return replace(self, hits=hits, misses=misses)

    def without_stray_hits(self) -> "HitCounts":
        """Return the same map without the hits that noise put beside a wall, mostly behind it.

        No beam crosses a cell behind a wall, so nothing else ever clears it. In a map that is resumed many
        times walls would thicken, and scans match anywhere in a thick wall: the map blurs and turns.
        """
        if not self.hits.size:
            return self
        most, size = np.pad(self.hits, STRAY_CELLS), 2 * STRAY_CELLS + 1  # within STRAY_CELLS of each cell
        for axis in (0, 1):
            most = sliding_window_view(most, size, axis=axis).max(axis=-1)
        hits = self.hits.copy()
        hits[hits <= np.multiply(STRAY_SHARE, most)] = 0
        return replace(self, hits=hits)

    def crop_to_known(self) -> "HitCounts":
        """Return the same map without the empty rows and columns around what was observed."""
        known = (self.hits > 0) | (self.misses > 0)
        rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        if not rows.size:
            return replace(self, hits=self.hits[:0, :0], misses=self.misses[:0, :0])
        box = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        row, col = self.first_cell
        first_cell = row + int(rows[0]), col + int(cols[0])
        return replace(self, hits=self.hits[box], misses=self.misses[box], first_cell=first_cell)

    def grid(self, occupied_fraction: float) -> OccupancyGrid:
        """Return the map; a cell with at least this share of hits is occupied."""
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
