"""The global costmap kept from cycle to cycle: only where a layer has changed is anything computed again.

Layers: the map, the keep-out mask, the hits of scan and memory; inflation over their sum. The new map is
compared with the last one row by row (a memory comparison, the only work that grows with the map); distances
and costs are renewed in the box round the changes, grown by the inflation's reach.
"""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, inflation_reach, inflation_table
from thumper.navigation.costmap.filters import is_closed
from thumper.navigation.costmap.inflation import INSCRIBED, UNKNOWN, ByteArray, squared_distances
from thumper.navigation.footprint import Footprint

MAP, CLOSED, HIT = 1, 2, 4  # bits of a cell's layers; any of them makes it an obstacle
NO_BOX = np.array((np.iinfo(np.int64).max, np.iinfo(np.int64).max, -1, -1))


@kernel
def take_map(
    cells: CellArray, known: CellArray, layers: ByteArray, lethal_percent: int, box: NDArray[np.int64]
) -> None:
    """Bring `known` and the MAP bit of `layers`, shape (rows, cols), up to `cells`; grow `box` (row_min,
    col_min, row_max, col_max) round the cells that turned obstacle, free or unknown.
    """
    rows, cols = cells.shape
    for row in range(rows):
        new, old = cells[row], known[row]
        differs = 0
        for col in range(cols):
            differs |= new[col] ^ old[col]
        if differs == 0:
            continue
        for col in range(cols):
            if new[col] == old[col]:
                continue
            was, now = old[col] >= lethal_percent, new[col] >= lethal_percent
            if was != now:
                layers[row, col] ^= MAP
            if was != now or (old[col] < 0) != (new[col] < 0):
                box[0], box[1] = min(box[0], row), min(box[1], col)
                box[2], box[3] = max(box[2], row), max(box[3], col)
            old[col] = new[col]


@kernel
def take_hits(
    hits: NDArray[np.int64], marked: NDArray[np.int64], layers: ByteArray, box: NDArray[np.int64]
) -> None:
    """Move the HIT bit from the cells `marked` to the cells `hits`, flat indices; grow `box` likewise."""
    flat, cols = layers.ravel(), layers.shape[1]
    seen = np.uint8(128)  # set on a cell that stays: it is no change
    for cell in hits:
        flat[cell] |= seen
    for cell in marked:
        if flat[cell] & seen == 0:
            flat[cell] &= ~np.uint8(HIT)
            if flat[cell] == 0:
                row, col = cell // cols, cell % cols
                box[0], box[1] = min(box[0], row), min(box[1], col)
                box[2], box[3] = max(box[2], row), max(box[3], col)
    for cell in hits:
        before = flat[cell] & ~seen
        flat[cell] = before | np.uint8(HIT)
        if before == 0:
            row, col = cell // cols, cell % cols
            box[0], box[1] = min(box[0], row), min(box[1], col)
            box[2], box[3] = max(box[2], row), max(box[3], col)


class CostmapLayers:
    """The costmap of a growing map; `update` gives the same arrays each time, renewed in place."""

    def __init__(
        self, footprint: Footprint, options: CostmapOptions, keepout: OccupancyGrid | None = None
    ) -> None:
        self._footprint = footprint
        self._options = options
        self._keepout = keepout
        self._geometry: tuple[object, ...] = ()
        self._marked: NDArray[np.int64]
        self._costmap: Costmap

    def update(self, grid: OccupancyGrid, hits_in_map_m: FloatArray) -> Costmap:
        """Return the costs of `build_costmap`; the arrays stay valid until the next call.

        `hits_in_map_m` has shape (n, 2) [m].
        """
        geometry = (grid.cells.shape, grid.resolution_m, grid.origin_x_m, grid.origin_y_m)
        box = NO_BOX.copy()
        rows, cols = grid.cells.shape
        if geometry != self._geometry:
            self._begin(grid)
            self._geometry = geometry
            box[:] = 0, 0, rows - 1, cols - 1
        take_map(grid.cells, self._known, self._layers, self._options.lethal_percent, box)
        hits = self._cells_under(hits_in_map_m, grid)
        take_hits(hits, self._marked, self._layers, box)
        self._marked = hits
        if box[2] >= 0:
            self._renew(box)
        return self._costmap

    def _begin(self, grid: OccupancyGrid) -> None:
        shape = grid.cells.shape
        self._known: CellArray = np.zeros(shape, np.int8)
        self._layers: ByteArray = np.where(is_closed(self._keepout, grid), CLOSED, 0).astype(np.uint8)
        self._marked = np.empty(0, np.int64)
        self._reach = inflation_reach(self._footprint, self._options, grid.resolution_m)
        self._table = inflation_table(self._footprint, self._options, grid.resolution_m)
        self._costmap = Costmap(
            costs=np.empty(shape, np.uint8),
            squared_cells=np.empty(shape, np.int32),
            resolution_m=grid.resolution_m,
            origin_x_m=grid.origin_x_m,
            origin_y_m=grid.origin_y_m,
        )

    def _cells_under(self, points_m: FloatArray, grid: OccupancyGrid) -> NDArray[np.int64]:
        points_m = points_m[np.isfinite(points_m).all(axis=1)]
        cells = np.floor((points_m - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m).astype(np.int64)
        rows, cols = grid.cells.shape
        inside = (cells >= 0).all(axis=1) & (cells[:, 0] < cols) & (cells[:, 1] < rows)
        return np.unique(cells[inside, 1] * cols + cells[inside, 0])

    def _renew(self, box: NDArray[np.int64]) -> None:
        """Distances and costs within the inflation's reach of the changed box."""
        (rows, cols), reach = self._layers.shape, self._reach
        top, left = max(0, int(box[0]) - reach), max(0, int(box[1]) - reach)
        bottom, right = min(rows, int(box[2]) + reach + 1), min(cols, int(box[3]) + reach + 1)
        # Obstacles up to another reach away count in there.
        outer_top, outer_left = max(0, top - reach), max(0, left - reach)
        outer = self._layers[outer_top : bottom + reach, outer_left : right + reach] != 0
        squared = squared_distances(outer, reach)
        inner = squared[top - outer_top : bottom - outer_top, left - outer_left : right - outer_left]
        self._costmap.squared_cells[top:bottom, left:right] = inner
        costs: ByteArray = self._table[inner]
        costs[(self._known[top:bottom, left:right] < 0) & (costs < INSCRIBED)] = UNKNOWN
        self._costmap.costs[top:bottom, left:right] = costs
