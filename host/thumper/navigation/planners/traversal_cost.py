"""The cost of crossing each cell of a costmap, for A*, navfn and the lattice planner."""

from dataclasses import dataclass
from functools import cache
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import MOST_INFLATED, UNKNOWN
from thumper.navigation.planners.cell_costs import CellCosts, CostArray
from thumper.navigation.planners.polyline import polyline_cost


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


def traversal_cost(costmap: Costmap, options: TraversalCostOptions) -> CellCosts:
    """Return the cost of each cell: 1 if free, rising to inf at the inscribed radius.

    Unknown cells cost 1 + `unknown_weight`, or inf if they are not allowed. The costmap is not copied, unless
    it is a part of a larger one: a search that goes on sees its changes.
    """
    return CellCosts(np.ascontiguousarray(costmap.costs), _cost_table(options))


@cache
def _cost_table(options: TraversalCostOptions) -> CostArray:
    """Return the traversal cost of each cost of a costmap, shape (256,)."""
    table = np.full(256, np.inf, np.float32)
    table[: MOST_INFLATED + 1] = 1.0 + options.obstacle_weight * np.arange(MOST_INFLATED + 1) / MOST_INFLATED
    if options.allow_unknown:
        table[UNKNOWN] = 1.0 + options.unknown_weight
    return table


def path_cost_m(costmap: Costmap, cells: CellCosts, path_m: FloatArray) -> float:
    """Return the cost of a path, shape (n, 2) [m of free space]; inf if it crosses a closed cell."""
    points = np.ascontiguousarray((path_m - costmap.origin_m) / costmap.resolution_m)
    return costmap.resolution_m * polyline_cost(cells, points)
