"""A* on a grid: 8 neighbours, no corner cutting, any cost per cell. Kernels.

Hart, Nilsson & Raphael, "A Formal Basis for the Heuristic Determination of Minimum Cost Paths" (1968).
"""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.common.resumable import ASTAR_CELLS, Search, run_to_end
from thumper.navigation.costmap.inflation import ByteArray, IntArray
from thumper.navigation.planners.binary_heap import doubled, heap_pop, heap_push
from thumper.navigation.planners.cell_costs import CellCosts, is_inside
from thumper.navigation.planners.sparse_memory import Reached, extend, reached_from, sparse_zeros

NO_GOAL = -1
UNTOUCHED, OPEN, CLOSED = 0, 1, 2
FIRST_ENTRIES = 4096


class AStarCells(NamedTuple):
    """What the search knows of each cell, shape (rows * cols,) each; untouched cells take no memory."""

    status: ByteArray  # UNTOUCHED, OPEN or CLOSED
    path_cost: FloatArray  # from the start [cells]; without meaning in untouched cells, final in closed ones
    parent: IntArray  # flat index of the previous cell, -1 at the start; without meaning in untouched cells
    reached: Reached  # box round the closed cells


class Heap(NamedTuple):
    """The open cells in order of their estimated total cost."""

    keys: FloatArray
    items: IntArray


@kernel
def astar_slice(
    ground: CellCosts, cells: AStarCells, heap: Heap, size: int, goal: int, budget: int
) -> tuple[Heap, int, bool]:
    """Close up to `budget` cells; return the heap, its new size, and whether the goal was closed.

    The search has ended at the goal, or without it when the heap is empty.
    """
    rows, cols = ground.costs.shape
    costs, table = ground.costs.ravel(), ground.table
    status, path_cost, parent, reached = cells
    keys, items = heap
    steps = np.array((1, -1, cols, -cols, cols + 1, cols - 1, -cols + 1, -cols - 1))
    d_cols = np.array((1, -1, 0, 0, 1, -1, 1, -1))
    d_rows = np.array((0, 0, 1, -1, 1, 1, -1, -1))
    goal_row, goal_col = goal // cols, goal % cols
    diagonal_extra = math.sqrt(2.0) - 1.0
    while size > 0 and budget > 0:
        cell = heap_pop(keys, items, size)
        size -= 1
        if status[cell] == CLOSED:
            continue
        status[cell] = CLOSED
        budget -= 1
        if cell == goal:
            return Heap(keys, items), size, True
        row, col = cell // cols, cell % cols
        extend(reached, row, col)
        is_open = is_inside(row, col, rows, cols, 2)
        for k in range(8):
            neighbour = cell + steps[k]
            cost = table[costs[neighbour]]
            if status[neighbour] == CLOSED or not cost < np.inf:
                continue
            if not (is_open or is_inside(row + d_rows[k], col + d_cols[k], rows, cols, 1)):
                continue
            length = 1.0
            if k >= 4:
                beside, above = table[costs[cell + d_cols[k]]], table[costs[cell + cols * d_rows[k]]]
                if not (beside < np.inf and above < np.inf):
                    continue
                length = math.sqrt(2.0)
            candidate = path_cost[cell] + 0.5 * length * (table[costs[cell]] + cost)
            if status[neighbour] == OPEN and candidate >= path_cost[neighbour]:
                continue
            status[neighbour] = OPEN
            path_cost[neighbour] = candidate
            parent[neighbour] = cell
            heuristic = 0.0
            if goal >= 0:
                dx, dy = abs(col + d_cols[k] - goal_col), abs(row + d_rows[k] - goal_row)
                heuristic = max(dx, dy) + diagonal_extra * min(dx, dy)
            if size == keys.size:
                keys, items = doubled(keys), doubled(items)
            heap_push(keys, items, size, candidate + heuristic, neighbour)
            size += 1
    return Heap(keys, items), size, False


def search_astar(ground: CellCosts, start: int, goal: int) -> Search[AStarCells]:
    """Find the cheapest path from `start` to `goal`, or to every cell if `goal` is -1.

    A step costs its length [cells] times the mean cost of its two cells. `start` and `goal` are flat indices
    of cells that can be entered. A search that does not close the goal has closed all cells that can be
    reached.
    """
    rows, cols = ground.costs.shape
    reached = reached_from(*divmod(start, cols))
    cells = AStarCells(
        sparse_zeros(rows, cols, np.uint8, reached),
        sparse_zeros(rows, cols, np.float64, reached),
        sparse_zeros(rows, cols, np.int32, reached),
        reached,
    )
    heap = Heap(np.empty(FIRST_ENTRIES), np.empty(FIRST_ENTRIES, np.int32))
    cells.status[start], cells.path_cost[start], cells.parent[start] = OPEN, 0.0, -1
    heap_push(heap.keys, heap.items, 0, 0.0, start)
    size, found = 1, False
    while True:
        heap, size, found = astar_slice(ground, cells, heap, size, goal, ASTAR_CELLS)
        if found or size == 0:
            return cells
        yield


def astar(ground: CellCosts, start: int, goal: int) -> tuple[FloatArray, IntArray]:
    """Run `search_astar` at once; return cost, inf where it did not arrive, and parent of each cell."""
    status, path_cost, parent, _ = run_to_end(search_astar(ground, start, goal))
    return np.where(status == UNTOUCHED, np.inf, path_cost), np.where(status == UNTOUCHED, -1, parent)


@kernel
def trace_path(parent: IntArray, goal: int) -> IntArray:
    """Return the cells from the start to `goal`, flat indices, shape (n,)."""
    count = 1
    cell = goal
    while parent[cell] >= 0:
        cell = parent[cell]
        count += 1
    cells = np.empty(count, np.int32)
    cell = goal
    for i in range(count - 1, -1, -1):
        cells[i] = cell
        cell = parent[cell]
    return cells
