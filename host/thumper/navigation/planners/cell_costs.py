"""The cost of crossing the cells of a costmap, looked up where a search reaches them. Kernels in cells.

A search near the robot then costs the same in any map: nothing is computed for cells that it does not reach.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.inflation import ByteArray

CostArray = NDArray[np.float32]
INFINITE = np.float32(np.inf)


class CellCosts(NamedTuple):
    """The costs of a costmap and what they cost to cross [free cells].

    A cost is >= 1; inf is an obstacle, as are the first and last row and column.
    """

    costs: ByteArray  # shape (rows, cols), C order
    table: CostArray  # shape (256,): by cost

    def part(self, rows: slice, cols: slice) -> CostArray:
        """Return the cost of each cell of a part; its slices have a start and a stop."""
        part: CostArray = self.table[self.costs[rows, cols]]
        height, width = self.costs.shape
        row, col = np.arange(rows.start, rows.stop), np.arange(cols.start, cols.stop)
        part[(row == 0) | (row == height - 1)] = INFINITE
        part[:, (col == 0) | (col == width - 1)] = INFINITE
        return part


@kernel
def is_inside(row: int, col: int, rows: int, cols: int, edge: int) -> bool:
    """Return whether a cell is at least `edge` cells from the edge of the map."""
    return edge <= row < rows - edge and edge <= col < cols - edge


@kernel
def cost_at(cells: CellCosts, row: int, col: int) -> np.float32:
    """Return the cost of crossing a cell of the map."""
    rows, cols = cells.costs.shape
    return cells.table[cells.costs[row, col]] if is_inside(row, col, rows, cols, 1) else INFINITE
