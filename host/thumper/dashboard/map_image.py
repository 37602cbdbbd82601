"""The map as the pages have it: a PNG of what changed, or of the whole map for a page that has none."""

from typing import Any

from thumper.dashboard.binary_packet import grid_png
from thumper.maps.cell_changes import NO_CELLS, CellBox
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid

Part = tuple[dict[str, Any], bytes]
"""For the header: position and size of the map, and under `patch` the part of it that the PNG holds, if not
all: row, column, rows, columns. And the PNG."""


class MapImage:
    """The newest map, and what the pages do not have yet."""

    def __init__(self) -> None:
        self._grid: OccupancyGrid | None = None
        self._changed: CellBox | None = None  # since the last part; None: all
        self._png = b""  # of the whole map, once a page has asked for it

    def replace(self, grid: OccupancyGrid) -> None:
        """Take another map. Its cells are changed from now on."""
        self._grid, self._changed, self._png = grid, None, b""

    def change(self, box: CellBox, cells: CellArray) -> None:
        """Set the cells in a box. Raises ValueError if it is not inside the map."""
        if box.is_empty:
            return
        rows, columns = (0, 0) if self._grid is None else self._grid.cells.shape
        if self._grid is None or box.bottom > rows or box.right > columns:
            raise ValueError(f"{box} is outside the map, {rows} x {columns}")
        self._grid.cells[box.window] = cells
        self._png = b""
        if self._changed is not None:
            self._changed = self._changed.union(box)

    def part(self) -> Part | None:
        """Return what has changed since the last call; None if nothing has."""
        changed, self._changed = self._changed, NO_CELLS
        if changed is None:
            return self.whole()
        if changed.is_empty or self._grid is None:
            return None
        patch = (changed.top, changed.left, changed.bottom - changed.top, changed.right - changed.left)
        return grid_info(self._grid) | {"patch": patch}, grid_png(self._grid.cells[changed.window])

    def whole(self) -> Part | None:
        """Return the whole map; None before the first."""
        if self._grid is None:
            return None
        self._png = self._png or grid_png(self._grid.cells)
        return grid_info(self._grid), self._png


def grid_info(grid: OccupancyGrid) -> dict[str, Any]:
    """Return position and size of a grid."""
    rows, columns = grid.cells.shape
    return {
        "resolution_m": grid.resolution_m,
        "origin": [grid.origin_x_m, grid.origin_y_m],
        "columns": columns,
        "rows": rows,
    }
