"""The occupancy grid: output of the mappers, input of the planners."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.attribute_hints import HintedAttributes
from thumper.common.geometry import FloatArray
from thumper.maps.cell_changes import CellBox, RenderHistory, new_history

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
MAX_CELLS = 100_000_000  # that a file or message may hold: 500 m by 500 m at 5 cm
BLOCK = 32  # cells by which a grid is padded

CellArray = NDArray[np.int8]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class OccupancyGrid(HintedAttributes):
    """Cells, shape (rows, columns), int8: -1 unknown, else occupancy in percent (0 free ... 100 occupied).

    Row 0 is the smallest y, column 0 the smallest x: cell [row, col] covers
    x in origin_x_m + resolution_m * [col, col + 1), y likewise with row. The frame is `map`.
    """

    cells: CellArray
    resolution_m: float
    origin_x_m: float
    origin_y_m: float
    # Not a parameter, so that `replace` does not copy it to a grid with other cells. Cells never change.
    history: RenderHistory = field(default_factory=new_history, init=False, compare=False)

    def __repr__(self) -> str:
        rows, columns = self.cells.shape
        size = f"{columns * self.resolution_m:.1f} m x {rows * self.resolution_m:.1f} m"
        known = 100.0 * np.mean(self.cells != UNKNOWN) if self.cells.size else 0.0
        return f"<OccupancyGrid: {columns} x {rows} cells, {size}, {known:.0f} % known>"

    def with_history(self, history: RenderHistory) -> "OccupancyGrid":
        """Set where this grid differs from earlier renders of the same map; return it."""
        object.__setattr__(self, "history", history)
        return self

    def changed_since(self, older: RenderHistory | None) -> CellBox | None:
        """Return the box round all cells that differ from an older render; None if it is not known."""
        return self.history.changed_since(older)

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return (row, col) of the cell that contains the point; it may lie outside the grid."""
        col = int(np.floor((x_m - self.origin_x_m) / self.resolution_m))
        row = int(np.floor((y_m - self.origin_y_m) / self.resolution_m))
        return row, col

    def centre_of(self, row: int, col: int) -> tuple[float, float]:
        """Return (x_m, y_m) of the cell's centre."""
        return (
            self.origin_x_m + (col + 0.5) * self.resolution_m,
            self.origin_y_m + (row + 0.5) * self.resolution_m,
        )

    def with_a_cell(self) -> "OccupancyGrid":
        """Return this grid, or with an unknown cell if it has none: no image is empty.

        A map of ground where the lidar has reached nothing has no cells.
        """
        return (
            self if self.cells.size else self.including(self.origin_x_m, self.origin_y_m, self.resolution_m)
        )

    def including(self, x_m: float, y_m: float, margin_m: float) -> "OccupancyGrid":
        """Return this grid, padded with unknown cells to `margin_m` beyond the point on every side, or more.

        It grows by whole blocks, so that its shape stays the same for most points on the way.
        """
        row_lo, col_lo = self.cell_of(x_m - margin_m, y_m - margin_m)
        row_hi, col_hi = self.cell_of(x_m + margin_m, y_m + margin_m)
        rows, cols = self.cells.shape
        below, left, above, right = (
            BLOCK * math.ceil(max(0, cells) / BLOCK)
            for cells in (-row_lo, -col_lo, row_hi + 1 - rows, col_hi + 1 - cols)
        )
        if not (below or left or above or right):
            return self
        return OccupancyGrid(
            cells=np.pad(self.cells, ((below, above), (left, right)), constant_values=UNKNOWN),
            resolution_m=self.resolution_m,
            origin_x_m=self.origin_x_m - left * self.resolution_m,
            origin_y_m=self.origin_y_m - below * self.resolution_m,
        )

    def values_at(self, points_m: FloatArray) -> NDArray[np.int8]:
        """Return the cells under points, shape (n, 2) [m]; unknown outside the grid; shape (n,)."""
        cells = np.floor((points_m - (self.origin_x_m, self.origin_y_m)) / self.resolution_m).astype(np.int64)
        inside = (cells >= 0).all(axis=1) & (cells < self.cells.shape[::-1]).all(axis=1)
        values = np.full(len(points_m), UNKNOWN, dtype=np.int8)
        values[inside] = self.cells[cells[inside, 1], cells[inside, 0]]
        return values

    def contains(self, row: int, col: int) -> bool:
        """Return whether [row, col] is a cell of this grid."""
        rows, cols = self.cells.shape
        return bool(0 <= row < rows and 0 <= col < cols)
