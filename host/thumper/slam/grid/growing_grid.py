"""A hit/miss grid that grows with the known world."""

import math
from typing import Literal

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.resumable import bands_of
from thumper.lidar.deskew import ScanPoints
from thumper.maps.cell_changes import CellBox
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import UNKNOWN, CellArray, OccupancyGrid
from thumper.slam.grid.occupancy_render import OccupancyRender
from thumper.slam.grid.patch_distances import squared_distances
from thumper.slam.grid.ray_casting import GridBeams, valid_beams
from thumper.slam.grid.scan_inserter import add_distances, insert_scan, resume_counts
from thumper.slam.scan_matching.distance_field import (
    CountArray,
    FieldArray,
    insertion_rule,
    metric_distances,
)
from thumper.slam.scan_matching.patch_grid import (
    PRIVATE,
    PatchField,
    PatchGrid,
    grown_table,
    larger_pool,
    make_patches,
    own_memory,
    patches_over,
    plain,
)
from thumper.slam.scan_matching.patches import SIDE, IndexArray, empty_pool

BLOCK = 64  # the extent grows by multiples of this many cells ...
GROWTH = 0.125  # ... and by at least this share of its side: each growth renders the whole map again
# Room for 67 million cells, so that the pool is hardly ever copied. It takes memory when it is written, on
# Windows at once.
FIRST_PATCHES = 1 << (16 if PRIVATE else 14)
LAYER_MARGIN = 2  # cells: the rounding of the rays
OBSTACLES_PER_PART = 3000  # whose distances are added in one part of the work: 1 to 2 ms

Distances = Literal["now", "deferred", "never"]


class Scratch:
    """Memory for one scan at a time: the grids of a mapper can share it."""

    def __init__(self) -> None:
        self._layer: CountArray = np.zeros(0, dtype=np.uint8)

    def layer(self, size: int) -> CountArray:
        """Return zeros, shape (size,), which must be zeros again after the scan."""
        if self._layer.size < size:
            self._layer = np.zeros(size, dtype=np.uint8)
        return self._layer[:size]


class HitGrid:
    """Hit and miss counts on a grid fixed to the map frame, and the distances to its occupied cells.

    Distances are cut off at `max_distance_m`. `corner_m` is the map's (x, y) at the corner of cell [0, 0]. It
    moves by whole cells when the map grows. Only patches where beams have been take memory. Without
    `distances` the grid cannot be matched against, and a cell takes two bytes instead of three. With
    `deferred` ones, scans change the counts alone, in half the time, until `add_distances` has added them.
    """

    def __init__(
        self,
        resolution_m: float,
        max_distance_m: float,
        occupied_fraction: float,
        *,
        distances: Distances = "now",
    ) -> None:
        """Start without cells. Distances are cut off at `max_distance_m`, at most 127 cells."""
        self.resolution_m = resolution_m
        self.max_distance_cells = max(1, min(127, round(max_distance_m / resolution_m)))
        self.max_distance_m = float(np.float32(self.max_distance_cells * resolution_m))
        self.occupied_fraction = occupied_fraction
        levels = squared_distances(self.max_distance_cells)
        self._rule = insertion_rule(levels, self.max_distance_cells, occupied_fraction)
        self._distances = distances
        self._patches_measured = 0  # of the table, while the distances are deferred
        self._metres = metric_distances(self.max_distance_cells, resolution_m)
        self._first_row = self._first_col = 0
        self.shape = (0, 0)
        self._render: OccupancyRender | None = None  # until the map grows
        self._pool = empty_pool(FIRST_PATCHES, levels[-1], distances=distances != "never", zeros=own_memory)
        self._table: IndexArray = np.zeros((0, 0), dtype=np.int32)
        self.scratch = Scratch()

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
        grid._set_extent(
            CellBox(row - edge, col - edge, row + hits.shape[0] + edge, col + hits.shape[1] + edge)
        )
        hits, misses = hits.astype(np.uint8), misses.astype(np.uint8)
        for band in bands_of(hits.shape):
            known = np.argwhere((hits[band] > 0) | (misses[band] > 0)).astype(np.int32)
            known += np.array((band.start + edge, edge), np.int32)
            while not make_patches(known, grid.max_distance_cells, grid.cells):
                grid._pool = larger_pool(grid._pool, grid._rule.levels[-1])
        resume_counts(hits, misses, (edge, edge), grid.cells, grid._rule)
        return grid

    def counts(self) -> HitCounts:
        """Return a copy of the counts."""
        return HitCounts(
            hits=self.hits,
            misses=self.misses,
            first_cell=(self._first_row, self._first_col),
            resolution_m=self.resolution_m,
        )

    @property
    def field(self) -> PatchField:
        """The distance field, for the matching kernels. Valid until the next insertion."""
        row, col = self._first_row % SIDE, self._first_col % SIDE
        level, size_m = self._pool.distance, self.resolution_m
        return PatchField(self._table, level, self._metres, row, col, self.shape, size_m, self.max_distance_m)

    @property
    def cells(self) -> PatchGrid:
        """The counts, for kernels. Valid until the next insertion."""
        return PatchGrid(self._table, self._pool, self._first_row % SIDE, self._first_col % SIDE)

    @property
    def hits(self) -> CountArray:
        """A copy of the hits, shape (rows, columns)."""
        return plain(self.cells, self._pool.hits, self.shape)

    @property
    def misses(self) -> CountArray:
        """A copy of the misses."""
        return plain(self.cells, self._pool.misses, self.shape)

    @property
    def distance_m(self) -> FieldArray:
        """A copy of the distances [m]."""
        return self.distances_m(1)

    def distances_m(self, step: int) -> FieldArray:
        """Return the distances [m] of every `step`-th row and column."""
        levels = plain(self.cells, self._pool.distance, self.shape)
        return self._metres.take(levels[::step, ::step])

    @property
    def corner_m(self) -> tuple[float, float]:
        """(x, y) of the corner of cell [0, 0] in the map."""
        return self._first_col * self.resolution_m, self._first_row * self.resolution_m

    def insert(self, map_from_base: Pose2, points: ScanPoints) -> None:
        """Insert a scan taken at the pose."""
        pose = np.array([map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad])
        moved, box = valid_beams(points.origins_m, points.ends_m, points.kinds, pose, self.resolution_m)
        if box.is_empty:
            return
        self._ensure_covers(box)
        (top, rows), (left, cols) = (
            patches_over(low - LAYER_MARGIN, high + LAYER_MARGIN)
            for low, high in ((box.top, box.bottom), (box.left, box.right))
        )
        corner = np.array(self.corner_m)
        beams = GridBeams(
            (moved.origins - corner) / self.resolution_m,
            (moved.ends - corner) / self.resolution_m,
            moved.kinds,
        )
        layer = self.scratch.layer(rows * cols * SIDE * SIDE).reshape(rows * SIDE, cols * SIDE)
        first = top - self._first_row // SIDE, left - self._first_col // SIDE
        rule = self._rule if self.keeps_distances else self._rule._replace(max_distance_cells=0)
        while not insert_scan(beams, layer, first, self.cells, rule):
            self._pool = larger_pool(self._pool, self._rule.levels[-1])
        if self._render is not None:
            top, left, bottom, right = box  # with one more cell on each side for the rounding of the rays
            row, col = self._first_row, self._first_col
            self._render.add_scan(CellBox(top - row - 1, left - col - 1, bottom - row + 1, right - col + 1))

    @property
    def keeps_distances(self) -> bool:
        """Whether each scan changes the distances, too."""
        return self._distances == "now"

    def add_distances(self) -> bool:
        """Add a part of the deferred distances; return whether all are there. No scan may come in between."""
        while self._distances == "deferred":
            first = self._patches_measured
            last = add_distances(first, OBSTACLES_PER_PART, self.cells, self._rule)
            self._patches_measured = last
            if last == self._table.size:
                self._distances = "now"
            elif last > first:
                break
            else:
                self._pool = larger_pool(self._pool, self._rule.levels[-1])
        return self._distances != "deferred"

    def occupied(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """Return the mask of occupied cells, shape (rows, columns)."""
        all_hits, misses = self.hits, self.misses
        occupied = all_hits > 0
        hits = all_hits[occupied].astype(np.float32)  # exact up to 2^24
        occupied[occupied] = hits >= np.float32(self.occupied_fraction) * (hits + misses[occupied])
        return occupied

    def grid(self, *, percent: bool) -> OccupancyGrid:
        """Return the map as free, occupied or unknown, or as the share of hits in percent.

        The former is the same object until a scan changes a cell, and never changes: the runtime asks for it
        ten times per second.
        """
        if not percent:
            if self._render is None:
                empty = self._as_grid(np.full(self.shape, UNKNOWN, np.int8))
                self._render = OccupancyRender(empty, self.cells, self.occupied_fraction)
            return self._render.grid(self.cells)
        hits = self.hits
        total = hits.astype(np.int32) + self.misses
        share = np.rint(np.float32(100.0) * hits / np.maximum(total, 1)).astype(np.int8)
        return self._as_grid(np.where(total > 0, share, UNKNOWN).astype(np.int8))

    def _as_grid(self, cells: CellArray) -> OccupancyGrid:
        x_m, y_m = self.corner_m
        return OccupancyGrid(cells=cells, resolution_m=self.resolution_m, origin_x_m=x_m, origin_y_m=y_m)

    def _set_extent(self, box: CellBox) -> None:
        """Let the map cover a box, which holds the old one. Cells are counted from the map's origin."""
        (top, rows), (left, cols) = patches_over(box.top, box.bottom), patches_over(box.left, box.right)
        old_top, old_left = (
            (self._first_row // SIDE, self._first_col // SIDE) if self.shape[0] else (top, left)
        )
        self._table = grown_table(self._table, (rows, cols), old_top - top, old_left - left)
        self._first_row, self._first_col = box.top, box.left
        self.shape = (box.bottom - box.top, box.right - box.left)
        self._render = None

    def _with_margin(self, box: CellBox) -> CellBox:
        """Return the cells that the distances around the cells of a box need."""
        margin = self.max_distance_cells + 2
        return CellBox(box.top - margin, box.left - margin, box.bottom + margin, box.right + margin)

    def _ensure_covers(self, box: CellBox) -> None:
        """Grow the arrays until a box of cells, and the distances around it, lie inside.

        Cells are counted from the map's origin.
        """
        box, (rows, cols) = self._with_margin(box), self.shape
        old = CellBox(self._first_row, self._first_col, self._first_row + rows, self._first_col + cols)
        if not rows:
            old = CellBox(box.top, box.left, box.top, box.left)
        elif old.union(box) == old:
            return
        self._set_extent(
            CellBox(
                old.top - _added(old.top - box.top, rows),
                old.left - _added(old.left - box.left, cols),
                old.bottom + _added(box.bottom - old.bottom, rows),
                old.right + _added(box.right - old.right, cols),
            )
        )


def _added(missing: int, side: int) -> int:
    """Return by how many cells an array of this side grows where `missing` are needed."""
    return BLOCK * math.ceil(max(missing, GROWTH * side) / BLOCK) if missing > 0 else 0
