"""The global costmap, kept between cycles and updated only where a layer has changed.

Layers: map, keep-out masks, hits of scan and memory; inflation over their union. Each update reads the part
of the map that has changed since the previous one by its `RenderHistory`. Another map is compared whole, row
by row. Distances and costs are computed again in the box round the changes, grown by the inflation
radius. All of a new or grown map are computed in slices, in a large one over several cycles.
"""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.common.resumable import Search, SlicedSearch, bands_of, merged
from thumper.maps.cell_changes import CellBox, RenderHistory
from thumper.maps.distance_transform import squared_distances
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid
from thumper.navigation.costmap.costmap import (
    Costmap,
    CostmapOptions,
    inflation_radius_cells,
    inflation_table,
)
from thumper.navigation.costmap.filters import Masks, keepout_cells
from thumper.navigation.costmap.inflation import INSCRIBED, UNKNOWN, ByteArray
from thumper.navigation.footprint import Footprint

MAP, KEEPOUT, HIT = 1, 2, 4  # bits of a cell's layers; any of them makes it an obstacle
BANDS_AT_ONCE = 2  # with up to as many bands, a map of 30 m x 30 m, the costmap is complete in one cycle
NO_BOX = np.array((np.iinfo(np.int64).max, np.iinfo(np.int64).max, -1, -1))


@kernel
def update_map_layer(
    cells: CellArray,
    known: CellArray,
    layers: ByteArray,
    lethal_percent: int,
    part: CellBox,
    box: NDArray[np.int64],
) -> None:
    """Update `known` and the MAP bit of `layers`, shape (rows, cols), to the `part` of `cells`.

    Grows `box` (row_min, col_min, row_max, col_max) round the cells that became obstacle, free or unknown.
    """
    left = part.left
    for row in range(part.top, part.bottom):
        new, old = cells[row, left : part.right], known[row, left : part.right]
        differs = 0
        for k in range(new.size):
            differs |= new[k] ^ old[k]
        if differs == 0:
            continue
        for k in range(new.size):
            if new[k] == old[k]:
                continue
            was, now, col = old[k] >= lethal_percent, new[k] >= lethal_percent, left + k
            if was != now:
                layers[row, col] ^= MAP
            if was != now or (old[k] < 0) != (new[k] < 0):
                box[0], box[1] = min(box[0], row), min(box[1], col)
                box[2], box[3] = max(box[2], row), max(box[3], col)
            old[k] = new[k]


@kernel
def update_hit_layer(
    hits: NDArray[np.int64], marked: NDArray[np.int64], layers: ByteArray, box: NDArray[np.int64]
) -> None:
    """Move the HIT bit from the cells `marked` to the cells `hits`, flat indices; grow `box` alike."""
    flat, cols = layers.ravel(), layers.shape[1]
    stays = np.uint8(128)  # a cell that was and is a hit: no change
    for cell in hits:
        flat[cell] |= stays
    for cell in marked:
        if flat[cell] & stays == 0:
            flat[cell] &= ~np.uint8(HIT)
            if flat[cell] == 0:
                row, col = cell // cols, cell % cols
                box[0], box[1] = min(box[0], row), min(box[1], col)
                box[2], box[3] = max(box[2], row), max(box[3], col)
    for cell in hits:
        before = flat[cell] & ~stays
        flat[cell] = before | np.uint8(HIT)
        if before == 0:
            row, col = cell // cols, cell % cols
            box[0], box[1] = min(box[0], row), min(box[1], col)
            box[2], box[3] = max(box[2], row), max(box[3], col)


class CostmapLayers:
    """The costmap of a growing map; `update` returns the same arrays, updated in place, until it grows."""

    def __init__(self, footprint: Footprint, options: CostmapOptions) -> None:
        self._footprint = footprint
        self._options = options
        self._keepout: Masks = ()
        self._has_new_keepout = False
        self._geometry: tuple[object, ...] = ()
        self._history: RenderHistory | None = None  # of the map in `_known`
        self._known: CellArray = np.empty((0, 0), np.int8)
        self._layers: ByteArray = np.empty((0, 0), np.uint8)
        self._marked: NDArray[np.int64] = np.empty(0, np.int64)
        self._radius = 0
        self._table: ByteArray = np.empty(0, np.uint8)
        self._costmap: Costmap | None = None
        self._building = SlicedSearch[Costmap]()

    def set_keepout(self, keepout: Masks) -> None:
        """Replace the keep-out masks; the next update closes and opens the cells that differ."""
        self._keepout, self._has_new_keepout = keepout, True

    def update(self, grid: OccupancyGrid, hits_in_map_m: FloatArray) -> Costmap | None:
        """Return the costs that `build_costmap` would; the arrays are valid until the next call.

        `hits_in_map_m` has shape (n, 2) [m]. A new or grown map takes up to one call per 400,000 cells. Until
        then returns the costs as they were before it grew; None for a new one.
        """
        geometry = (grid.cells.shape, grid.resolution_m, grid.origin_x_m, grid.origin_y_m)
        if geometry != self._geometry:
            self._geometry = geometry
            self._building.start(merged(self._build(grid), BANDS_AT_ONCE))
        if self._building.is_running:
            self._costmap = self._building.advance() or self._costmap
        if self._costmap is None or self._building.is_running:
            return self._costmap
        box = NO_BOX.copy()
        rows, cols = grid.cells.shape
        part = grid.changed_since(self._history) or CellBox(0, 0, rows, cols)
        self._history = grid.history
        if self._has_new_keepout:
            self._update_keepout(grid, box)
        update_map_layer(grid.cells, self._known, self._layers, self._options.lethal_percent, part, box)
        hits = self._cells_under(hits_in_map_m, grid)
        update_hit_layer(hits, self._marked, self._layers, box)
        self._marked = hits
        if box[2] >= 0:
            self._recompute(self._costmap, box)
        return self._costmap

    def _build(self, grid: OccupancyGrid) -> Search[Costmap]:
        """Return the costmap of a map without hits."""
        self._history = grid.history
        self._known = np.zeros(grid.cells.shape, np.int8)
        self._layers = np.zeros(grid.cells.shape, np.uint8)
        self._marked = np.empty(0, np.int64)
        self._radius = inflation_radius_cells(self._footprint, self._options, grid.resolution_m)
        self._table = inflation_table(self._footprint, self._options, grid.resolution_m)
        costmap = _uninitialised(grid)
        self._update_keepout(grid, NO_BOX.copy())
        rows, cols = grid.cells.shape
        read = 0
        for number, band in enumerate(bands_of(grid.cells.shape)):
            if number:
                yield
            # Obstacles up to two radii below the band, as in `_recompute`, affect its cells.
            part = CellBox(read, 0, min(rows, band.stop + 2 * self._radius), cols)
            update_map_layer(
                grid.cells, self._known, self._layers, self._options.lethal_percent, part, NO_BOX.copy()
            )
            read = part.bottom
            self._recompute(costmap, np.array((band.start, 0, band.stop - 1, cols - 1)))
        return costmap

    def _update_keepout(self, grid: OccupancyGrid, box: NDArray[np.int64]) -> None:
        """Set the KEEPOUT bit by the masks; grow `box` round the cells that changed."""
        self._has_new_keepout = False
        differs = keepout_cells(self._keepout, grid) != (self._layers & KEEPOUT != 0)
        rows, cols = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
        if len(rows) == 0:
            return
        self._layers[differs] ^= KEEPOUT
        box[:2] = np.minimum(box[:2], (rows[0], cols[0]))
        box[2:] = np.maximum(box[2:], (rows[-1], cols[-1]))

    def _cells_under(self, points_m: FloatArray, grid: OccupancyGrid) -> NDArray[np.int64]:
        points_m = points_m[np.isfinite(points_m).all(axis=1)]
        cells = np.floor((points_m - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m).astype(np.int64)
        rows, cols = grid.cells.shape
        inside = (cells >= 0).all(axis=1) & (cells[:, 0] < cols) & (cells[:, 1] < rows)
        return np.unique(cells[inside, 1] * cols + cells[inside, 0])

    def _recompute(self, costmap: Costmap, box: NDArray[np.int64]) -> None:
        """Compute distances and costs within the inflation radius of the changed box."""
        (rows, cols), radius = self._layers.shape, self._radius
        top, left = max(0, int(box[0]) - radius), max(0, int(box[1]) - radius)
        bottom, right = min(rows, int(box[2]) + radius + 1), min(cols, int(box[3]) + radius + 1)
        # Obstacles up to another radius away affect the cells in there.
        outer_top, outer_left = max(0, top - radius), max(0, left - radius)
        outer = self._layers[outer_top : bottom + radius, outer_left : right + radius] != 0
        squared = squared_distances(outer, radius)
        inner = squared[top - outer_top : bottom - outer_top, left - outer_left : right - outer_left]
        costmap.squared_cells[top:bottom, left:right] = inner
        costs: ByteArray = self._table[inner]
        costs[(self._known[top:bottom, left:right] < 0) & (costs < INSCRIBED)] = UNKNOWN
        costmap.costs[top:bottom, left:right] = costs


def _uninitialised(grid: OccupancyGrid) -> Costmap:
    """Return a costmap in the layout of a grid; its costs and distances are not set."""
    return Costmap(
        costs=np.empty(grid.cells.shape, np.uint8),
        squared_cells=np.empty(grid.cells.shape, np.int32),
        resolution_m=grid.resolution_m,
        origin_x_m=grid.origin_x_m,
        origin_y_m=grid.origin_y_m,
    )
