"""The A* planner: cheapest grid path with clearance, pulled tight and rounded so that it can be driven."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.geometry import FloatArray, Pose2
from thumper.navigation.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.grid_search import NO_GOAL, CostArray, search, trace
from thumper.navigation.inflation import INSCRIBED, MOST_INFLATED, UNKNOWN
from thumper.navigation.path import polyline_cost, pull_string, relax, resample
from thumper.navigation.planner import PlanResult

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
    """Price of each cell, shape (rows, cols): 1 free, rising with the cost, inf within the inscribed radius.

    The border row and column are inf, as `search` asks.
    """
    table = np.full(256, np.inf, np.float32)
    table[: MOST_INFLATED + 1] = 1.0 + options.obstacle_weight * np.arange(MOST_INFLATED + 1) / MOST_INFLATED
    if options.allow_unknown:
        table[UNKNOWN] = 1.0 + options.unknown_weight
    prices: CostArray = table[costmap.costs]
    prices[0] = prices[-1] = np.inf
    prices[:, 0] = prices[:, -1] = np.inf
    return prices


def nearest_open(prices: CostArray, row: int, col: int, radius_cells: float) -> tuple[int, int] | None:
    """The passable cell nearest to (row, col) within a radius, or None."""
    reach = math.ceil(radius_cells)
    top, left = max(0, row - reach), max(0, col - reach)
    window = prices[top : max(0, row + reach + 1), left : max(0, col + reach + 1)]
    rows, cols = np.nonzero(np.isfinite(window))
    squared = (rows + top - row) ** 2 + (cols + left - col) ** 2
    if squared.size == 0 or squared.min() > radius_cells**2:
        return None
    nearest = int(np.argmin(squared))
    return int(rows[nearest]) + top, int(cols[nearest]) + left


class AStarPlanner:
    """`Planner` by A* on the costmap."""

    def __init__(self, options: AStarOptions) -> None:
        self._options = options

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the cheapest path, shape (n, 2), about one cell between points, or why there is none.

        A goal that cannot be entered is replaced by the nearest reachable place within its tolerance.
        """
        prices = cell_prices(costmap, self._options)
        resolution_m = costmap.resolution_m
        start_m = np.array((map_from_base.x_m, map_from_base.y_m))
        goal_m = np.array((goal.x_m, goal.y_m))
        (start_row, goal_row), (start_col, goal_col) = costmap.cells_of(np.stack((start_m, goal_m)))
        rows, cols = prices.shape
        if not (0 <= goal_row < rows and 0 <= goal_col < cols):
            return PlanResult(reason=f"the goal {goal} is outside the map")
        if not (0 <= start_row < rows and 0 <= start_col < cols):
            return PlanResult(reason="the robot is outside the map")
        start = nearest_open(prices, start_row, start_col, self._options.escape_radius_m / resolution_m)
        if start is None:
            return PlanResult(
                reason="the robot stands inside an obstacle: no free cell within "
                f"{self._options.escape_radius_m} m"
            )
        start_index, goal_index = start[0] * cols + start[1], int(goal_row) * cols + int(goal_col)
        reason = ""
        cost, parent = np.empty(0), np.empty(0, np.int32)
        if np.isfinite(prices[goal_row, goal_col]):
            cost, parent = search(prices, start_index, goal_index)
        if cost.size == 0 or not np.isfinite(cost[goal_index]):
            cost, parent = search(prices, start_index, NO_GOAL)
            reached = cost.reshape(rows, cols).astype(np.float32)
            nearest = nearest_open(reached, int(goal_row), int(goal_col), goal.tolerance_m / resolution_m)
            if nearest is None:
                blocked = not np.isfinite(prices[goal_row, goal_col])
                where = "lies inside or too near an obstacle" if blocked else "is walled in by obstacles"
                return PlanResult(reason=f"no way to the goal {goal}: it {where}")
            goal_index = nearest[0] * cols + nearest[1]
            goal_m = costmap.origin_m + (np.array((nearest[1], nearest[0])) + 0.5) * resolution_m
            reason = f"the goal {goal} cannot be entered: going to ({goal_m[0]:.2f}, {goal_m[1]:.2f}) instead"
        cells = trace(parent, goal_index)
        points = np.column_stack((cells % cols, cells // cols)) + 0.5
        points[-1] = (goal_m - costmap.origin_m) / resolution_m
        if start == (start_row, start_col):
            points[0] = (start_m - costmap.origin_m) / resolution_m
        path = self._drivable(prices, points)
        if start != (start_row, start_col):
            path = np.vstack(((start_m - costmap.origin_m) / resolution_m, path))
        return PlanResult(path_m=path * resolution_m + costmap.origin_m, reason=reason)

    def _drivable(self, prices: CostArray, points: FloatArray) -> FloatArray:
        if len(points) < 2:
            return np.repeat(points, 2, axis=0)
        path = resample(pull_string(prices, points, PULL_REACH), PATH_SPACING_CELLS)
        relax(prices, path, self._options.smoothing_rounds)
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
