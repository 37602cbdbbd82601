"""A* on a grid: 8 neighbours, no corner cutting, any cost per cell. Kernels.

Hart, Nilsson & Raphael, "A Formal Basis for the Heuristic Determination of Minimum Cost Paths" (1968).
"""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.inflation import IntArray
from thumper.navigation.planners.binary_heap import doubled, heap_pop, heap_push

CostArray = NDArray[np.float32]

NO_GOAL = -1


@kernel
def astar(cell_costs: CostArray, start: int, goal: int) -> tuple[FloatArray, IntArray]:
    """Find the cheapest path from `start` to `goal`, or to every cell if `goal` is -1.

    Parameters
    ----------
    cell_costs : ndarray, shape (rows, cols), float32
        Cost of crossing a cell, >= 1; inf is an obstacle. The border cells must all be inf. A step costs its
        length [cells] times the mean cost of its two cells.
    start, goal : int
        Flat indices.

    Returns
    -------
    path_cost : ndarray, shape (rows * cols,)
        Cost from the start [cells]; inf where the search did not arrive. Final at the goal, and everywhere
        without a goal.
    parent : ndarray, shape (rows * cols,)
        Flat index of the previous cell; -1 at the start and where the search did not arrive.
    """
    rows, cols = cell_costs.shape
    costs = cell_costs.ravel()
    path_cost = np.full(rows * cols, np.inf)
    parent = np.full(rows * cols, -1, np.int32)
    closed = np.zeros(rows * cols, np.bool_)
    keys, items = np.empty(4096, np.float64), np.empty(4096, np.int32)
    steps = np.array((1, -1, cols, -cols, cols + 1, cols - 1, -cols + 1, -cols - 1))
    d_cols = np.array((1, -1, 0, 0, 1, -1, 1, -1))
    d_rows = np.array((0, 0, 1, -1, 1, 1, -1, -1))
    goal_row, goal_col = goal // cols, goal % cols
    diagonal_extra = math.sqrt(2.0) - 1.0

    path_cost[start] = 0.0
    heap_push(keys, items, 0, 0.0, start)
    size = 1
    while size > 0:
        cell = heap_pop(keys, items, size)
        size -= 1
        if closed[cell]:
            continue
        if cell == goal:
            break
        closed[cell] = True
        row, col = cell // cols, cell % cols
        for k in range(8):
            neighbour = cell + steps[k]
            if closed[neighbour] or not costs[neighbour] < np.inf:
                continue
            length = 1.0
            if k >= 4:
                if not (costs[cell + d_cols[k]] < np.inf and costs[cell + cols * d_rows[k]] < np.inf):
                    continue
                length = math.sqrt(2.0)
            candidate = path_cost[cell] + 0.5 * length * (costs[cell] + costs[neighbour])
            if candidate >= path_cost[neighbour]:
                continue
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
    return path_cost, parent


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
