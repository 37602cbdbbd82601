"""The A* planner: the cheapest grid path with clearance, shortened and smoothed."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, run_to_end
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import INSCRIBED, UNKNOWN
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar_search import CLOSED, search_astar, trace_path
from thumper.navigation.planners.cell_costs import CellCosts
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import resample, shortcut, smooth
from thumper.navigation.planners.start_and_goal_cells import find_ends, goal_end
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, path_cost_m, traversal_cost

SHORTCUT_POINTS = 100  # longest run that one shortcut replaces
SLICE_POINTS = 400  # of the path that are shortened in one cycle
PATH_SPACING_CELLS = 1.0
SMOOTHING_ROUNDS = 30


class AStarPlanner:
    """`Planner` by A* on the costmap."""

    def __init__(self, options: TraversalCostOptions) -> None:
        self._options = options

    def search(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> Search[PlanResult]:
        """Return the cheapest path, shape (n, 2), about one cell between points, or why there is none.

        If the goal cannot be entered, the path ends at the nearest reachable cell within its tolerance.
        """
        ground = self.cell_costs(costmap)
        ends = find_ends(costmap, ground, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        end = goal_end(costmap, ground, ends, goal)
        if isinstance(end, str):
            return PlanResult(reason=end, unreachable=True)
        cells = yield from search_astar(ground, ends.start, end.cell)
        if cells.status[end.cell] != CLOSED:
            end = goal_end(costmap, ground, ends, goal, cells.status == CLOSED)
            if isinstance(end, str):
                return PlanResult(reason=end, unreachable=True)
        cols = ground.costs.shape[1]
        traced = trace_path(cells.parent, end.cell)
        points = np.column_stack((traced % cols, traced // cols)) + 0.5
        points[-1] = end.point_cells
        if not ends.start_moved:
            points[0] = ends.start_cells
        path = yield from _shortened(ground, points)
        if ends.start_moved:
            path = np.vstack((ends.start_cells, path))
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m, reason=end.message)

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Run `search` at once."""
        return run_to_end(self.search(costmap, map_from_base, goal))

    def cell_costs(self, costmap: Costmap) -> CellCosts:
        """Return the traversal cost of each cell."""
        return traversal_cost(costmap, self._options)

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Return the cost of a path [m of free space].

        It is inf if the path enters an inscribed zone, or unknown space that the options forbid.
        """
        return path_cost_m(costmap, self.cell_costs(costmap), path_m)


def _shortened(ground: CellCosts, points: FloatArray) -> Search[FloatArray]:
    """Return the path shortened, evenly spaced and smoothed, shape (n, 2) [cells]."""
    if len(points) < 2:
        return np.repeat(points, 2, axis=0)
    pieces = []
    for begin in range(0, len(points) - 1, SLICE_POINTS):
        if begin:
            yield
        pieces.append(shortcut(ground, points[begin : begin + SLICE_POINTS + 1], SHORTCUT_POINTS))
    path = resample(np.vstack((*(piece[:-1] for piece in pieces), points[-1:])), PATH_SPACING_CELLS)
    smooth(ground, path, SMOOTHING_ROUNDS)
    return path


def is_off(costmap: Costmap, points_m: FloatArray) -> NDArray[np.bool_]:
    """Return which points, shape (n, 2), are off the costmap."""
    rows, cols = costmap.cells_of(points_m)
    height, width = costmap.costs.shape
    off: NDArray[np.bool_] = (rows < 0) | (cols < 0) | (rows >= height) | (cols >= width)
    return off


def is_blocked(costmap: Costmap, path_m: FloatArray) -> bool:
    """Return whether a path point, shape (n, 2), is inside an inscribed zone or off the map."""
    if is_off(costmap, path_m).any():
        return True
    costs = costmap.costs[costmap.cells_of(path_m)]
    return bool(((costs >= INSCRIBED) & (costs != UNKNOWN)).any())
