"""navfn: Dijkstra with an interpolated potential and the gradient path down it.

Brock & Khatib, "High-speed navigation using the global dynamic window approach" (1999), with the costs of
ROS's navfn: 50 for a free cell and 0.8 per unit of inflated cost.
"""

from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, run_to_end
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.cell_costs import CellCosts
from thumper.navigation.planners.dijkstra import search_dijkstra
from thumper.navigation.planners.gradient_path import gradient_path
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.start_and_goal_cells import find_ends, goal_end
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, path_cost_m, traversal_cost

STEP_CELLS = 0.5
MARGIN = 6.0  # how far beyond the goal's potential the search goes: the gradient needs the neighbours
OBSTACLE_WEIGHT = 4.032  # 0.8 * 252 / 50, as in ROS's navfn


class NavfnPlanner:
    """`Planner` by Dijkstra and gradient descent; takes its obstacle weight from ROS's navfn.

    A `guided` search expands toward the goal first: the same path, found sooner.
    """

    def __init__(self, options: TraversalCostOptions, *, guided: bool = True) -> None:
        self._options = replace(options, obstacle_weight=OBSTACLE_WEIGHT)
        self._guided = guided

    def search(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> Search[PlanResult]:
        """Return the cheapest path, shape (n, 2), half a cell between points, or why there is none.

        If the goal cannot be entered, the path ends at the nearest reachable cell within its tolerance.
        """
        cells = self.cell_costs(costmap)
        ends = find_ends(costmap, cells, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        end = goal_end(costmap, cells, ends, goal)
        if isinstance(end, str):
            return PlanResult(reason=end, unreachable=True)
        potential = yield from search_dijkstra(cells, ends.start, end.cell, self._guided, MARGIN)
        if potential[end.cell] == 0.0:
            end = goal_end(costmap, cells, ends, goal, potential > 0.0)
            if isinstance(end, str):
                return PlanResult(reason=end, unreachable=True)
        cols, point = cells.costs.shape[1], end.point_cells
        descent = gradient_path(potential, cols, float(point[0]), float(point[1]), STEP_CELLS)
        if len(descent) == 0:
            return PlanResult(reason=f"no path to the goal {goal}: the search did not reach it")
        path = descent[::-1]
        if not ends.start_moved and len(path) > 1:
            path = path[1:]  # the robot is in this point's cell
        path = np.vstack((ends.start_cells, path))
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m, reason=end.message)

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Run `search` at once."""
        return run_to_end(self.search(costmap, map_from_base, goal))

    def cell_costs(self, costmap: Costmap) -> CellCosts:
        """Return the traversal cost of each cell."""
        return traversal_cost(costmap, self._options)

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Return the cost of a path [m of free space]; inf if it enters what the options forbid."""
        return path_cost_m(costmap, self.cell_costs(costmap), path_m)
