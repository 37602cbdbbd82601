"""A* on a grid: 8 neighbours, no corner cutting, any cost per cell. A kernel with its own binary heap.

Hart, Nilsson & Raphael, "A Formal Basis for the Heuristic Determination of Minimum Cost Paths" (1968).
"""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.inflation import IntArray

CostArray = NDArray[np.float32]

NO_GOAL = -1

Number = TypeVar("Number", np.float64, np.int32)


@kernel
def _push(keys: FloatArray, items: IntArray, size: int, key: float, item: int) -> None:
    slot = size
    while slot > 0:
        parent = (slot - 1) >> 1
        if keys[parent] <= key:
            break
        keys[slot] = keys[parent]
        items[slot] = items[parent]
        slot = parent
    keys[slot] = key
    items[slot] = item


@kernel
def _drop_root(keys: FloatArray, items: IntArray, size: int) -> None:
    """Remove the smallest of `size` entries; `size - 1` remain."""
    last = size - 1
    key, item = keys[last], items[last]
    slot = 0
    while True:
        child = 2 * slot + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[slot] = keys[child]
        items[slot] = items[child]
        slot = child
    keys[slot] = key
    items[slot] = item


@kernel
def _grown(array: NDArray[Number]) -> NDArray[Number]:
    larger = np.empty(2 * array.size, array.dtype)
    larger[: array.size] = array
    return larger


@kernel
def search(cell_costs: CostArray, start: int, goal: int) -> tuple[FloatArray, IntArray]:
    """Cheapest way from `start` to `goal`; with `goal` -1, to every cell.

    Parameters
    ----------
    cell_costs : ndarray, shape (rows, cols), float32
        Price of a cell's width, >= 1; inf is an obstacle. The border cells must all be inf. A step costs its
        length [cells] times the mean price of its two cells.
    start, goal : int
        Flat indices.

    Returns
    -------
    cost : ndarray, shape (rows * cols,)
        Cost from the start [cells]; inf where the search never came. Final at the goal, and everywhere
        without one.
    parent : ndarray, shape (rows * cols,)
        Flat index of the cell before; -1 at the start and where the search never came.
    """
    rows, cols = cell_costs.shape
    prices = cell_costs.ravel()
    cost = np.full(rows * cols, np.inf)
    parent = np.full(rows * cols, -1, np.int32)
    closed = np.zeros(rows * cols, np.bool_)
    keys, items = np.empty(4096, np.float64), np.empty(4096, np.int32)
    steps = np.array((1, -1, cols, -cols, cols + 1, cols - 1, -cols + 1, -cols - 1))
    d_cols = np.array((1, -1, 0, 0, 1, -1, 1, -1))
    d_rows = np.array((0, 0, 1, -1, 1, 1, -1, -1))
    goal_row, goal_col = goal // cols, goal % cols
    diagonal_extra = math.sqrt(2.0) - 1.0

    cost[start] = 0.0
    _push(keys, items, 0, 0.0, start)
    size = 1
    while size > 0:
        cell = items[0]
        _drop_root(keys, items, size)
        size -= 1
        if closed[cell]:
            continue
        if cell == goal:
            break
        closed[cell] = True
        row, col = cell // cols, cell % cols
        for k in range(8):
            neighbour = cell + steps[k]
            if closed[neighbour] or not prices[neighbour] < np.inf:
                continue
            length = 1.0
            if k >= 4:
                if not (prices[cell + d_cols[k]] < np.inf and prices[cell + cols * d_rows[k]] < np.inf):
                    continue
                length = math.sqrt(2.0)
            candidate = cost[cell] + 0.5 * length * (prices[cell] + prices[neighbour])
            if candidate >= cost[neighbour]:
                continue
            cost[neighbour] = candidate
            parent[neighbour] = cell
            to_go = 0.0
            if goal >= 0:
                dx, dy = abs(col + d_cols[k] - goal_col), abs(row + d_rows[k] - goal_row)
                to_go = max(dx, dy) + diagonal_extra * min(dx, dy)
            if size == keys.size:
                keys, items = _grown(keys), _grown(items)
            _push(keys, items, size, candidate + to_go, neighbour)
            size += 1
    return cost, parent


@kernel
def trace(parent: IntArray, goal: int) -> IntArray:
    """Cells from the start to `goal`, flat indices, shape (n,)."""
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
