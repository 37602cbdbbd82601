"""The A* planner: the cheapest grid path with clearance, shortened and smoothed."""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import INSCRIBED, UNKNOWN
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar_search import NO_GOAL, CostArray, astar, trace_path
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import resample, shortcut, smooth
from thumper.navigation.planners.start_and_goal_cells import find_ends, nearest_reachable_goal
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, path_cost_m, traversal_cost

SHORTCUT_POINTS = 100  # longest run that one shortcut replaces
PATH_SPACING_CELLS = 1.0
SMOOTHING_ROUNDS = 30


class AStarPlanner:
    """`Planner` by A* on the costmap."""

    def __init__(self, options: TraversalCostOptions) -> None:
        self._options = options

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the cheapest path, shape (n, 2), about one cell between points, or why there is none.

        If the goal cannot be entered, the path ends at the nearest reachable cell within its tolerance.
        """
        cell_costs = self.cell_costs(costmap)
        ends = find_ends(costmap, cell_costs, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        cols = cell_costs.shape[1]
        target, point, message = ends.goal, ends.goal_cells, ""
        path_cost, parent = np.empty(0), np.empty(0, np.int32)
        if np.isfinite(cell_costs.flat[target]):
            path_cost, parent = astar(cell_costs, ends.start, target)
        if path_cost.size == 0 or not np.isfinite(path_cost[target]):
            path_cost, parent = astar(cell_costs, ends.start, NO_GOAL)
            found = nearest_reachable_goal(costmap, cell_costs, path_cost, ends, goal)
            if isinstance(found, str):
                return PlanResult(reason=found, unreachable=True)
            target, point, message = found
        cells = trace_path(parent, target)
        points = np.column_stack((cells % cols, cells // cols)) + 0.5
        points[-1] = point
        if not ends.start_moved:
            points[0] = ends.start_cells
        path = _shortened(cell_costs, points)
        if ends.start_moved:
            path = np.vstack((ends.start_cells, path))
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m, reason=message)

    def cell_costs(self, costmap: Costmap) -> CostArray:
        """Return the traversal cost of each cell."""
        return traversal_cost(costmap, self._options)

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Return the cost of a path [m of free space].

        It is inf if the path enters an inscribed zone, or unknown space that the options forbid.
        """
        return path_cost_m(costmap, self.cell_costs(costmap), path_m)


def _shortened(cell_costs: CostArray, points: FloatArray) -> FloatArray:
    """Return the path shortened, evenly spaced and smoothed, shape (n, 2) [cells]."""
    if len(points) < 2:
        return np.repeat(points, 2, axis=0)
    path = resample(shortcut(cell_costs, points, SHORTCUT_POINTS), PATH_SPACING_CELLS)
    smooth(cell_costs, path, SMOOTHING_ROUNDS)
    return path


def is_blocked(costmap: Costmap, path_m: FloatArray) -> bool:
    """Return whether a path point, shape (n, 2), is inside an inscribed zone or off the map."""
    rows, cols = costmap.cells_of(path_m)
    inside = (rows >= 0) & (cols >= 0) & (rows < costmap.costs.shape[0]) & (cols < costmap.costs.shape[1])
    if not inside.all():
        return True
    costs = costmap.costs[rows, cols]
    return bool(((costs >= INSCRIBED) & (costs != UNKNOWN)).any())
