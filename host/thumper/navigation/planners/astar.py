"""The A* planner: cheapest grid path with clearance, pulled tight and rounded so that it can be driven."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import INSCRIBED, UNKNOWN
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar_search import NO_GOAL, CostArray, search, trace
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import polyline_cost, resample, shortcut, smooth
from thumper.navigation.planners.start_and_goal_cells import locate, substitute
from thumper.navigation.planners.traversal_cost import price_cells

PULL_REACH = 100  # longest stretch made straight at once [points]
PATH_SPACING_CELLS = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AStarOptions:
    """What the planner prefers. All weights 0 gives the shortest octile path."""

    # Extra price of the dearest inflated cell, in free cells; more keeps further from obstacles.
    obstacle_weight: Annotated[float, Ge(0)] = 6.0
    # Whether the path may cross cells never seen; a robot that maps as it goes needs it.
    allow_unknown: bool = True
    # Extra price of an unknown cell, in free cells; more prefers seen ground.
    unknown_weight: Annotated[float, Ge(0)] = 1.0
    # How far the search may begin from a robot that stands too near an obstacle [m].
    escape_radius_m: Annotated[float, Gt(0)] = 0.30
    # Rounds of corner rounding; 0 leaves straight pieces.
    smoothing_rounds: Annotated[int, Ge(0)] = 30


def cell_prices(costmap: Costmap, options: AStarOptions) -> CostArray:
    """Price of each cell by these options; see `price_cells`."""
    unknown = options.unknown_weight if options.allow_unknown else None
    return price_cells(costmap, options.obstacle_weight, unknown)


class AStarPlanner:
    """`Planner` by A* on the costmap."""

    def __init__(self, options: AStarOptions) -> None:
        self._options = options

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the cheapest path, shape (n, 2), about one cell between points, or why there is none.

        A goal that cannot be entered is replaced by the nearest reachable place within its tolerance.
        """
        prices = cell_prices(costmap, self._options)
        ends = locate(costmap, prices, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        cols = prices.shape[1]
        target, point, told = ends.goal, ends.goal_cells, ""
        cost, parent = np.empty(0), np.empty(0, np.int32)
        if np.isfinite(prices.flat[target]):
            cost, parent = search(prices, ends.start, target)
        if cost.size == 0 or not np.isfinite(cost[target]):
            cost, parent = search(prices, ends.start, NO_GOAL)
            found = substitute(costmap, prices, cost, ends, goal)
            if isinstance(found, str):
                return PlanResult(reason=found, closed=True)
            target, point, told = found
        cells = trace(parent, target)
        points = np.column_stack((cells % cols, cells // cols)) + 0.5
        points[-1] = point
        if not ends.start_moved:
            points[0] = ends.start_cells
        path = self._drivable(prices, points)
        if ends.start_moved:
            path = np.vstack((ends.start_cells, path))
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m, reason=told)

    def _drivable(self, prices: CostArray, points: FloatArray) -> FloatArray:
        if len(points) < 2:
            return np.repeat(points, 2, axis=0)
        path = resample(shortcut(prices, points, PULL_REACH), PATH_SPACING_CELLS)
        smooth(prices, path, self._options.smoothing_rounds)
        return path

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Cost of a path on this costmap [m of free way].

        It is inf when the path enters an inscribed zone or unknown
        ground that the options forbid."""
        prices = cell_prices(costmap, self._options)
        cells = np.ascontiguousarray((path_m - costmap.origin_m) / costmap.resolution_m)
        return costmap.resolution_m * polyline_cost(prices, cells)


def is_blocked(costmap: Costmap, path_m: FloatArray) -> bool:
    """Whether a path point, shape (n, 2), lies inside an inscribed zone or off the map."""
    rows, cols = costmap.cells_of(path_m)
    inside = (rows >= 0) & (cols >= 0) & (rows < costmap.costs.shape[0]) & (cols < costmap.costs.shape[1])
    if not inside.all():
        return True
    costs = costmap.costs[rows, cols]
    return bool(((costs >= INSCRIBED) & (costs != UNKNOWN)).any())
