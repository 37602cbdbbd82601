"""The cells of a map in the making: counts, distance field, and an array that grows with the known world."""

import math
import mmap
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import INVALID, ScanPoints
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import UNKNOWN, CellArray, OccupancyGrid
from thumper.slam.grid.scan_inserter import integrate, states
from thumper.slam.scan_matching.distance_field import mark

Number = TypeVar("Number", np.uint8, np.float32)

# On Windows memory of no file is private anyway, and there are no flags.
PRIVATE = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
BLOCK = 64  # the array grows by multiples of this many cells


class HitGrid:
    """Hit and miss counts on a grid that is fixed to the map frame, and the distances to its occupied cells.

    `corner_m` is the map's (x, y) at the corner of cell [0, 0]; it moves by whole cells when the array grows.
    Without `distances` nothing can be matched against the map, and a cell takes three bytes, not seven.
    """

    def __init__(
        self, resolution_m: float, reach_m: float, occupied_fraction: float, *, distances: bool = True
    ) -> None:
        """Start without cells; distances are cut off at `reach_m`, at most 127 cells."""
        self.resolution_m = resolution_m
        self._distances = distances
        self.reach = max(1, min(127, round(reach_m / resolution_m)))
        self.occupied_fraction = occupied_fraction
        self._first_row = self._first_col = 0
        self._shown: OccupancyGrid | None = None  # the map as last asked for, until a scan changes it
        self.hits = np.zeros((0, 0), dtype=np.uint8)
        self.misses = np.zeros((0, 0), dtype=np.uint8)
        self.distance_m = np.zeros((0, 0), dtype=np.float32)
        self._layer = np.zeros((0, 0), dtype=np.uint8)  # scratch, empty between the scans

    @classmethod
    def from_counts(
        cls, counts: HitCounts, resolution_m: float, reach_m: float, occupied_fraction: float
    ) -> "HitGrid":
        """Cells to go on with, from what another day or a finished map knows.

        Raises
        ------
        ThumperError
            They are of another size.
        """
        if abs(counts.resolution_m - resolution_m) > 1e-6:
            raise ThumperError(
                f"the map's cells are {counts.resolution_m:g} m: "
                f"set mapping.resolution_m = {counts.resolution_m:g} to map on in it",
                exit_code=EXIT_USAGE,
            )
        cells = cls(resolution_m, reach_m, occupied_fraction)
        counts = counts.limit_observations(occupied_fraction)
        edge = cells.reach + 2  # a map may end at its walls, but the distances to them do not
        (row, col), hits, misses = counts.first_cell, counts.hits, counts.misses
        cells._first_row, cells._first_col = row - edge, col - edge
        cells._grow(hits.shape[0] + 2 * edge, hits.shape[1] + 2 * edge, 0, 0)
        cells.hits[edge:-edge, edge:-edge], cells.misses[edge:-edge, edge:-edge] = hits, misses
        for row, col in np.argwhere(cells.occupied()):
            mark(int(row), int(col), cells.distance_m, resolution_m, cells.reach)
        return cells

    def counts(self) -> HitCounts:
        """A copy of what is known so far."""
        return HitCounts(
            hits=self.hits.copy(),
            misses=self.misses.copy(),
            first_cell=(self._first_row, self._first_col),
            resolution_m=self.resolution_m,
        )

    @property
    def reach_m(self) -> float:
        """Largest distance the field tells [m]."""
        return float(np.float32(self.reach * self.resolution_m))

    @property
    def corner_m(self) -> tuple[float, float]:
        """(x, y) of the corner of cell [0, 0] in the map."""
        return self._first_col * self.resolution_m, self._first_row * self.resolution_m

    def integrate(self, map_from_base: Pose2, points: ScanPoints) -> None:
        """Enter a scan that was taken at the pose."""
        said = points.kinds != INVALID
        if not said.any():
            return
        origins_m = map_from_base.apply(points.origins_m[said])
        ends_m = map_from_base.apply(points.ends_m[said])
        self._cover(np.concatenate((origins_m, ends_m)))
        corner = np.array(self.corner_m)
        self._shown = None
        integrate(
            (origins_m - corner) / self.resolution_m,
            (ends_m - corner) / self.resolution_m,
            points.kinds[said],
            self._layer,
            self.hits,
            self.misses,
            self.distance_m,
            self.resolution_m,
            self.reach,
            self.occupied_fraction,
        )

    def occupied(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """Mask of the occupied cells, shape (rows, columns)."""
        hits = self.hits.astype(np.float32)  # exact up to 2^24
        return (self.hits > 0) & (hits >= np.float32(self.occupied_fraction) * (hits + self.misses))

    def field_from_scratch(self) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
        """The distance field computed anew, which `distance_m` must equal at any time."""
        rows, cols = self.hits.shape
        distance_m = np.full((rows, cols), self.reach_m, dtype=np.float32)
        for row, col in np.argwhere(self.occupied()):
            mark(int(row), int(col), distance_m, self.resolution_m, self.reach)
        return distance_m

    def grid(self, *, percent: bool) -> OccupancyGrid:
        """The map as free, occupied or unknown, or with the share of hits in percent.

        The former is the same object until a scan is entered, and never changes: the loop asks ten times a
        second.
        """
        if not percent:
            if self._shown is None:
                self._shown = self._as_grid(states(self.hits, self.misses, self.occupied_fraction))
            return self._shown
        total = self.hits.astype(np.int32) + self.misses
        share = np.rint(np.float32(100.0) * self.hits / np.maximum(total, 1)).astype(np.int8)
        return self._as_grid(np.where(total > 0, share, UNKNOWN).astype(np.int8))

    def _as_grid(self, cells: CellArray) -> OccupancyGrid:
        x_m, y_m = self.corner_m
        return OccupancyGrid(cells=cells, resolution_m=self.resolution_m, origin_x_m=x_m, origin_y_m=y_m)

    def _grow(self, rows: int, cols: int, top: int, left: int) -> None:
        """Make the arrays larger, with what they hold at [top, left]; one by one, for they may be large."""
        window = np.s_[top : top + self.hits.shape[0], left : left + self.hits.shape[1]]
        self.hits = _grown(self.hits, (rows, cols), window, 0)
        self.misses = _grown(self.misses, (rows, cols), window, 0)
        if self._distances:
            self.distance_m = _grown(self.distance_m, (rows, cols), window, self.reach_m)
        self._layer = _zeros((rows, cols), np.dtype(np.uint8))
        self._shown = None

    def _cover(self, points_m: FloatArray) -> None:
        """Grow the arrays so that the points, and the field's reach around them, lie inside."""
        margin = self.reach + 2
        low = np.floor(points_m.min(axis=0) / self.resolution_m) - margin
        high = np.floor(points_m.max(axis=0) / self.resolution_m) + margin + 1
        rows, cols = self.hits.shape
        first_row, last_row = self._first_row, self._first_row + rows
        first_col, last_col = self._first_col, self._first_col + cols
        if rows and (
            low[0] >= first_col and low[1] >= first_row and high[0] <= last_col and high[1] <= last_row
        ):
            return
        if not rows:
            first_col = last_col = int(low[0])
            first_row = last_row = int(low[1])
        top = first_row - BLOCK * max(0, math.ceil((first_row - low[1]) / BLOCK))
        left = first_col - BLOCK * max(0, math.ceil((first_col - low[0]) / BLOCK))
        bottom = last_row + BLOCK * max(0, math.ceil((high[1] - last_row) / BLOCK))
        right = last_col + BLOCK * max(0, math.ceil((high[0] - last_col) / BLOCK))
        self._grow(bottom - top, right - left, first_row - top, first_col - left)
        self._first_row, self._first_col = top, left


def _grown(
    array: NDArray[Number], shape: tuple[int, int], window: tuple[slice, slice], fill: float
) -> NDArray[Number]:
    new = _zeros(shape, array.dtype)
    if fill:
        new[:] = fill
    new[window] = array
    return new


def _zeros(shape: tuple[int, int], dtype: np.dtype[Number]) -> NDArray[Number]:
    """In memory of its own, which goes back to the system with the array; malloc would keep much of it."""
    memory = mmap.mmap(-1, math.prod(shape) * dtype.itemsize, **PRIVATE)
    with suppress(AttributeError, OSError):  # not every system has huge pages
        memory.madvise(mmap.MADV_HUGEPAGE)
    return np.ndarray(shape, dtype, buffer=memory)
