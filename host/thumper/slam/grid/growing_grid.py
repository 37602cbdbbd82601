"""A hit/miss grid that grows with the known world."""

import math
import mmap
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, bands_of
from thumper.lidar.deskew import ScanPoints
from thumper.maps.cell_changes import CellBox
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import UNKNOWN, CellArray, OccupancyGrid
from thumper.slam.grid.occupancy_render import OccupancyRender
from thumper.slam.grid.ray_casting import GridBeams, valid_beams
from thumper.slam.grid.scan_inserter import HitCells, insert_scan
from thumper.slam.scan_matching.distance_field import (
    DistanceField,
    add_obstacles,
    insertion_rule,
    metric_distances,
)

Number = TypeVar("Number", np.uint8, np.float32)

# Anonymous memory on Windows is private anyway, and mmap has no flags there.
PRIVATE = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
BLOCK = 64  # the array grows by multiples of this many cells ...
GROWTH = 0.125  # ... and by at least this share of its side: each growth copies the whole map


class HitGrid:
    """Hit and miss counts on a grid fixed to the map frame, and the distances to its occupied cells.

    `corner_m` is the map's (x, y) at the corner of cell [0, 0]. It moves by whole cells when the array grows.
    Without `distances` the grid cannot be matched against, and a cell takes three bytes instead of seven.
    """

    def __init__(
        self, resolution_m: float, max_distance_m: float, occupied_fraction: float, *, distances: bool = True
    ) -> None:
        """Start without cells. Distances are cut off at `max_distance_m`, at most 127 cells."""
        self.resolution_m = resolution_m
        self._distances = distances
        self.max_distance_cells = max(1, min(127, round(max_distance_m / resolution_m)))
        self.occupied_fraction = occupied_fraction
        distances_m = metric_distances(self.max_distance_cells, resolution_m)
        self._rule = insertion_rule(distances_m, self.max_distance_cells, occupied_fraction)
        self._first_row = self._first_col = 0
        self._render: OccupancyRender | None = None  # until the array grows
        self.hits = np.zeros((0, 0), dtype=np.uint8)
        self.misses = np.zeros((0, 0), dtype=np.uint8)
        self.distance_m = np.zeros((0, 0), dtype=np.float32)
        self._layer = np.zeros((0, 0), dtype=np.uint8)  # scratch, zero between scans

    @classmethod
    def from_counts(
        cls, counts: HitCounts, resolution_m: float, max_distance_m: float, occupied_fraction: float
    ) -> "HitGrid":
        """Return a grid that continues from saved counts.

        Raises
        ------
        ThumperError
            The counts have another resolution.
        """
        if abs(counts.resolution_m - resolution_m) > 1e-6:
            raise ThumperError(
                f"the map has cells of {counts.resolution_m:g} m; "
                f"set mapping.resolution_m = {counts.resolution_m:g} to resume mapping in it",
                exit_code=EXIT_USAGE,
            )
        grid = cls(resolution_m, max_distance_m, occupied_fraction)
        counts = counts.without_stray_hits().crop_to_known().limit_observations(occupied_fraction)
        edge = grid.max_distance_cells + 2  # the map may end at its walls, but their distances do not
        (row, col), hits, misses = counts.first_cell, counts.hits, counts.misses
        grid._first_row, grid._first_col = row - edge, col - edge
        grid._grow(hits.shape[0] + 2 * edge, hits.shape[1] + 2 * edge, 0, 0)
        grid.hits[edge:-edge, edge:-edge], grid.misses[edge:-edge, edge:-edge] = hits, misses
        add_obstacles(np.argwhere(grid.occupied()), grid.distance_m, grid._rule)
        return grid

    def counts(self) -> HitCounts:
        """Return a copy of the counts."""
        return HitCounts(
            hits=self.hits.copy(),
            misses=self.misses.copy(),
            first_cell=(self._first_row, self._first_col),
            resolution_m=self.resolution_m,
        )

    @property
    def max_distance_m(self) -> float:
        """Cut-off of the distance field [m]."""
        return float(np.float32(self.max_distance_cells * self.resolution_m))

    @property
    def field(self) -> DistanceField:
        """The distance field, for the matching kernels. Valid until the next insertion."""
        return DistanceField(self.distance_m, self.resolution_m, self.max_distance_m)

    @property
    def corner_m(self) -> tuple[float, float]:
        """(x, y) of the corner of cell [0, 0] in the map."""
        return self._first_col * self.resolution_m, self._first_row * self.resolution_m

    def reserve(self, low_m: FloatArray, high_m: FloatArray) -> Search[None]:
        """Make an empty grid large enough for points between two corners, shape (2,), a band in each slice.

        Scans inserted there need no growth, which copies the whole map at once.
        """
        (left, top), (right, bottom) = (
            np.floor(m / self.resolution_m).astype(int).tolist() for m in (low_m, high_m)
        )
        box = self._with_margin(CellBox(top, left, bottom + 1, right + 1))
        rows, cols = box.bottom - box.top, box.right - box.left
        self._first_row, self._first_col = box.top, box.left
        self._render = None
        self.hits, self.misses, self._layer = (_zeros((rows, cols), np.dtype(np.uint8)) for _ in range(3))
        if self._distances:
            self.distance_m = _zeros((rows, cols), np.dtype(np.float32))
        for band in bands_of((rows, cols)):
            # The system gives memory at the first write: not all of it at the first scan.
            for array in (self.hits, self.misses, self._layer):
                array[band] = 0
            if self._distances:
                self.distance_m[band] = self.max_distance_m
            yield

    def insert(self, map_from_base: Pose2, points: ScanPoints) -> None:
        """Insert a scan taken at the pose."""
        pose = np.array([map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad])
        moved, box = valid_beams(points.origins_m, points.ends_m, points.kinds, pose, self.resolution_m)
        if box.is_empty:
            return
        self._ensure_covers(box)
        corner = np.array(self.corner_m)
        beams = GridBeams(
            (moved.origins - corner) / self.resolution_m,
            (moved.ends - corner) / self.resolution_m,
            moved.kinds,
        )
        insert_scan(beams, self._layer, HitCells(self.hits, self.misses, self.distance_m), self._rule)
        if self._render is not None:
            top, left, bottom, right = box  # with one more cell on each side for the rounding of the rays
            row, col = self._first_row, self._first_col
            self._render.add_scan(CellBox(top - row - 1, left - col - 1, bottom - row + 1, right - col + 1))

    def occupied(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """Return the mask of occupied cells, shape (rows, columns)."""
        occupied = self.hits > 0
        hits = self.hits[occupied].astype(np.float32)  # exact up to 2^24
        occupied[occupied] = hits >= np.float32(self.occupied_fraction) * (hits + self.misses[occupied])
        return occupied

    def distance_from_scratch(self) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
        """Return the distance field computed from the counts alone; `distance_m` always equals it."""
        rows, cols = self.hits.shape
        distance_m = np.full((rows, cols), self.max_distance_m, dtype=np.float32)
        add_obstacles(np.argwhere(self.occupied()), distance_m, self._rule)
        return distance_m

    def grid(self, *, percent: bool) -> OccupancyGrid:
        """Return the map as free, occupied or unknown, or as the share of hits in percent.

        The former is the same object until a scan changes a cell, and never changes: the runtime asks for it
        ten times per second.
        """
        if not percent:
            if self._render is None:
                empty = self._as_grid(np.full(self.hits.shape, UNKNOWN, np.int8))
                self._render = OccupancyRender(empty, self.occupied_fraction)
            return self._render.grid(self.hits, self.misses)
        total = self.hits.astype(np.int32) + self.misses
        share = np.rint(np.float32(100.0) * self.hits / np.maximum(total, 1)).astype(np.int8)
        return self._as_grid(np.where(total > 0, share, UNKNOWN).astype(np.int8))

    def _as_grid(self, cells: CellArray) -> OccupancyGrid:
        x_m, y_m = self.corner_m
        return OccupancyGrid(cells=cells, resolution_m=self.resolution_m, origin_x_m=x_m, origin_y_m=y_m)

    def _grow(self, rows: int, cols: int, top: int, left: int) -> None:
        """Enlarge the arrays, old content at [top, left]. One array at a time: they may be large."""
        window = np.s_[top : top + self.hits.shape[0], left : left + self.hits.shape[1]]
        self.hits = _enlarged(self.hits, (rows, cols), window, 0)
        self.misses = _enlarged(self.misses, (rows, cols), window, 0)
        if self._distances:
            self.distance_m = _enlarged(self.distance_m, (rows, cols), window, self.max_distance_m)
        self._layer = _zeros((rows, cols), np.dtype(np.uint8))
        self._render = None

    def _with_margin(self, box: CellBox) -> CellBox:
        """Return the cells that the distances around the cells of a box need."""
        margin = self.max_distance_cells + 2
        return CellBox(box.top - margin, box.left - margin, box.bottom + margin, box.right + margin)

    def _ensure_covers(self, box: CellBox) -> None:
        """Grow the arrays until a box of cells, and the distances around it, lie inside.

        Cells are counted from the map's origin.
        """
        box, (rows, cols) = self._with_margin(box), self.hits.shape
        old = CellBox(self._first_row, self._first_col, self._first_row + rows, self._first_col + cols)
        if not rows:
            old = CellBox(box.top, box.left, box.top, box.left)
        elif old.union(box) == old:
            return
        top, left = old.top - _added(old.top - box.top, rows), old.left - _added(old.left - box.left, cols)
        bottom = old.bottom + _added(box.bottom - old.bottom, rows)
        right = old.right + _added(box.right - old.right, cols)
        self._grow(bottom - top, right - left, old.top - top, old.left - left)
        self._first_row, self._first_col = top, left


def _added(missing: int, side: int) -> int:
    """Return by how many cells an array of this side grows where `missing` are needed."""
    return BLOCK * math.ceil(max(missing, GROWTH * side) / BLOCK) if missing > 0 else 0


def _enlarged(
    array: NDArray[Number], shape: tuple[int, int], window: tuple[slice, slice], fill: float
) -> NDArray[Number]:
    new, (rows, cols) = _zeros(shape, array.dtype), window
    if fill:  # around the window only: each byte written costs time
        new[: rows.start], new[rows.stop :] = fill, fill
        new[rows, : cols.start], new[rows, cols.stop :] = fill, fill
    new[window] = array
    return new


def _zeros(shape: tuple[int, int], dtype: np.dtype[Number]) -> NDArray[Number]:
    """Return zeros in their own memory, which returns to the system with the array (malloc keeps it)."""
    memory = mmap.mmap(-1, math.prod(shape) * dtype.itemsize, **PRIVATE)
    with suppress(AttributeError, OSError):  # not every system has huge pages
        memory.madvise(mmap.MADV_HUGEPAGE)
    return np.ndarray(shape, dtype, buffer=memory)
