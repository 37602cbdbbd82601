"""The cost of crossing each cell of a costmap, for A*, navfn and the lattice planner."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.bands import bands_of
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import MOST_INFLATED, UNKNOWN, ByteArray
from thumper.navigation.planners.astar_search import CostArray
from thumper.navigation.planners.polyline import polyline_cost
from thumper.navigation.resumable import Search


@dataclass(frozen=True, slots=True, kw_only=True)
class TraversalCostOptions:
    """What the planners avoid. With both weights 0 they minimise the path length."""

    # Extra cost of the most expensive inflated cell, in free cells; more keeps further from obstacles. navfn
    # uses ROS's 4.032 instead.
    obstacle_weight: Annotated[float, Ge(0)] = 6.0
    # Allow paths through unknown space; a robot that maps as it drives needs it.
    allow_unknown: bool = True
    # Extra cost of an unknown cell, in free cells; more prefers known space.
    unknown_weight: Annotated[float, Ge(0)] = 1.0
    # How far from the robot the search may start if the robot is too close to an obstacle [m].
    escape_radius_m: Annotated[float, Gt(0)] = 0.30


def traversal_cost(costmap: Costmap, options: TraversalCostOptions) -> CostArray:
    """Return the cost of each cell, shape (rows, cols): 1 if free, rising to inf at the inscribed radius.

    Unknown cells cost 1 + `unknown_weight`, or inf if they are not allowed. The border row and column are
    inf, as the search kernels require.
    """
    cell_costs: CostArray = _cost_table(options)[costmap.costs]
    _close_border(cell_costs)
    return cell_costs


def search_traversal_cost(costmap: Costmap, options: TraversalCostOptions) -> Search[CostArray]:
    """Return what `traversal_cost` does, one band of rows in each slice."""
    table, cell_costs = _cost_table(options), np.empty(costmap.costs.shape, np.float32)
    for rows in bands_of(costmap.costs.shape):
        if rows.start > 0:
            yield
        cell_costs[rows] = table[costmap.costs[rows]]
    _close_border(cell_costs)
    return cell_costs


def _close_border(cell_costs: CostArray) -> None:
    cell_costs[0] = cell_costs[-1] = np.inf
    cell_costs[:, 0] = cell_costs[:, -1] = np.inf


def _cost_table(options: TraversalCostOptions) -> CostArray:
    """Return the traversal cost of each cost of a costmap, shape (256,)."""
    table = np.full(256, np.inf, np.float32)
    table[: MOST_INFLATED + 1] = 1.0 + options.obstacle_weight * np.arange(MOST_INFLATED + 1) / MOST_INFLATED
    if options.allow_unknown:
        table[UNKNOWN] = 1.0 + options.unknown_weight
    return table


@kernel
def update_changed(costs: ByteArray, known: ByteArray, table: CostArray, cell_costs: CostArray) -> None:
    """Bring `known` and `cell_costs`, shape (rows, cols), up to date with `costs`; the border stays inf."""
    rows, cols = costs.shape
    for row in range(1, rows - 1):
        new, old = costs[row], known[row]
        differs = 0
        for col in range(cols):
            differs |= new[col] ^ old[col]
        if differs == 0:
            continue
        for col in range(cols):
            if new[col] != old[col]:
                old[col] = new[col]
                if 0 < col < cols - 1:
                    cell_costs[row, col] = table[new[col]]


class TraversalLayer:
    """The traversal cost of a costmap, updated only where that has changed; `update` returns one array."""

    def __init__(self, options: TraversalCostOptions) -> None:
        self._table = _cost_table(options)
        self._options = options
        self._known: ByteArray = np.empty((0, 0), np.uint8)
        self._cell_costs: CostArray = np.empty((0, 0), np.float32)

    def update(self, costmap: Costmap) -> CostArray:
        """Return what `traversal_cost` would; the array is valid until the next call."""
        if self._known.shape != costmap.costs.shape:
            self._known = costmap.costs.copy()
            self._cell_costs = traversal_cost(costmap, self._options)
        else:
            update_changed(costmap.costs, self._known, self._table, self._cell_costs)
        return self._cell_costs


def path_cost_m(costmap: Costmap, cell_costs: CostArray, path_m: FloatArray) -> float:
    """Return the cost of a path, shape (n, 2) [m of free space]; inf if it crosses a closed cell."""
    cells = np.ascontiguousarray((path_m - costmap.origin_m) / costmap.resolution_m)
    return costmap.resolution_m * polyline_cost(cell_costs, cells)
