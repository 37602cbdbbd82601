"""The carrot planner: a straight line toward the goal, as far as the robot can drive.

For docking and for following.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.numba_kernel import kernel
from thumper.common.resumable import Search
from thumper.common.texts import place_text
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.cell_costs import CellCosts
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import arc_lengths, resample
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, traversal_cost


class CarrotPlanner:
    """`Planner` that draws a line; checks the footprint, heading along the line, at every point."""

    def __init__(self, footprint: Footprint) -> None:
        self._footprint = footprint

    def search(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> Search[PlanResult]:
        """Return what `plan` returns: one line needs no second slice."""
        yield from ()
        return self.plan(costmap, map_from_base, goal)

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the line to the goal, or to the last free point before an obstacle with a message."""
        start_m, goal_m = np.array((map_from_base.x_m, map_from_base.y_m)), np.array((goal.x_m, goal.y_m))
        line_m = resample(np.vstack((start_m, goal_m)), costmap.resolution_m)
        (_, goal_row), (_, goal_col) = costmap.cells_of(np.vstack((start_m, goal_m)))
        rows, cols = costmap.costs.shape
        if not (0 <= goal_row < rows and 0 <= goal_col < cols):
            return PlanResult(reason=f"the goal {goal} is outside the map")
        free = self._free_points(costmap, line_m, map_from_base)
        if free < 2:
            return PlanResult(
                reason=f"no straight path to the goal {goal}: an obstacle is directly ahead of the robot"
            )
        if free == len(line_m):
            return PlanResult(path_m=line_m)
        x_m, y_m = line_m[free - 1]
        if math.dist((x_m, y_m), (goal.x_m, goal.y_m)) > goal.tolerance_m:
            return PlanResult(
                reason=f"no straight path to the goal {goal}: blocked at {place_text(x_m, y_m)}"
            )
        message = f"the straight path to the goal {goal} is blocked: going as far as {place_text(x_m, y_m)}"
        return PlanResult(path_m=line_m[:free], reason=message)

    def cell_costs(self, costmap: Costmap) -> CellCosts:
        """Return the default traversal cost of each cell: the line may cross unknown space."""
        return traversal_cost(costmap, TraversalCostOptions())

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Return the length of the path [m]; inf if an obstacle is on it."""
        start = Pose2(x_m=float(path_m[0, 0]), y_m=float(path_m[0, 1]))
        blocked = self._free_points(costmap, path_m, start) < len(path_m)
        return math.inf if blocked else float(arc_lengths(path_m)[-1])

    def _free_points(self, costmap: Costmap, line_m: FloatArray, start: Pose2) -> int:
        """Count the points of a line that the footprint passes in sequence from the start."""
        grid = CollisionGrid.from_costmap(costmap, self._footprint)
        touching = max(0, lethal_count(grid, False, start.x_m, start.y_m, start.theta_rad))
        leaving = int(np.searchsorted(arc_lengths(line_m), self._footprint.circumscribed_radius_m))
        dx_m, dy_m = line_m[-1] - line_m[0]
        theta_rad = wrap_angle(math.atan2(dy_m, dx_m))
        return free_points(grid, line_m, theta_rad, touching, leaving)


@kernel
def free_points(
    grid: CollisionGrid, line_m: FloatArray, theta_rad: float, touching: int, leaving: int
) -> int:
    """Count the points of a line, shape (n, 2), before the footprint touches an obstacle.

    Up to the index `leaving` it may have `touching` outline points on obstacles.
    """
    for index in range(line_m.shape[0]):
        hits = lethal_count(grid, False, line_m[index, 0], line_m[index, 1], theta_rad)
        if hits < 0 or hits > (touching if index <= leaving else 0):
            return index
    return int(line_m.shape[0])
