"""Whether two paths pass all obstacles on the same sides (homotopy class). The kernel is in cells.

The paths form a loop. They differ if the loop winds round an obstacle. The work grows with the loop's length
and the cells between the paths, not with the number of obstacles.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import IntArray

HALF_CELL = 0.5  # an obstacle is the middle of its cell


def is_same_side(new_m: FloatArray, old_m: FloatArray, costmap: Costmap) -> bool:
    """Return whether two paths, shape (n, 2) [m], pass all obstacles of a costmap on the same sides."""
    loop_m = np.vstack((old_m, new_m[::-1]))
    loop = (loop_m - costmap.origin_m) / costmap.resolution_m
    return not winds_round_obstacle(loop, np.ascontiguousarray(costmap.squared_cells))


@kernel
def winds_round_obstacle(loop: FloatArray, squared_cells: IntArray) -> bool:
    """Return whether a closed polyline, shape (n, 2) [cells], winds round the middle of an obstacle's cell.

    `squared_cells`, shape (rows, cols), is 0 at obstacles. The winding number of a cell counts the edges that
    cross its row to its right, upward 1 and downward -1 (Sunday, "Inclusion of a point in a polygon", 2001).
    """
    rows, cols = squared_cells.shape
    count = loop.shape[0]
    first_rows = np.empty(count, np.int64)  # by vertex: the first row whose middle is not below it
    for i in range(count):
        first_rows[i] = min(max(math.ceil(loop[i, 1] - HALF_CELL), 0), rows)
    crossings = 0
    for i in range(count):
        crossings += abs(first_rows[i] - first_rows[i - 1])
    # A list of crossings per row, from the last one found to the first.
    last = np.full(rows, -1)
    previous, ends, turns = np.empty((3, crossings), np.int64)
    found = 0
    for i in range(count):
        (x0, y0), (x1, y1) = loop[i - 1], loop[i]
        begin, end = first_rows[i - 1], first_rows[i]
        for row in range(min(begin, end), max(begin, end)):
            x = x0 + (row + HALF_CELL - y0) * (x1 - x0) / (y1 - y0)
            ends[found] = min(max(math.ceil(x - HALF_CELL), 0), cols)  # cells before it are left of the edge
            turns[found] = 1 if begin < end else -1
            previous[found], last[row] = last[row], found
            found += 1
    changes = np.zeros(cols + 1, np.int64)  # of the winding number along a row
    for row in range(rows):
        low, high = cols, 0
        k = last[row]
        while k >= 0:
            changes[ends[k]] += turns[k]
            low, high = min(low, ends[k]), max(high, ends[k])
            k = previous[k]
        winding = 0
        for col in range(high - 1, low - 1, -1):
            winding += changes[col + 1]
            changes[col + 1] = 0
            if winding != 0 and squared_cells[row, col] == 0:
                return True
        changes[low] = 0
    return False
