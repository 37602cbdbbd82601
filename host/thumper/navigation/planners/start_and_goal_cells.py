"""Convert a pose and a goal to the cells between which a search runs, or report why it cannot."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar_search import CostArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchEnds:
    """Start and goal on a grid: flat cell indices, and points, shape (2,) [cells]."""

    start: int
    goal: int
    start_cells: FloatArray
    goal_cells: FloatArray
    start_moved: bool  # the search starts at the nearest free cell instead of at the robot


def nearest_passable(
    cell_costs: CostArray, row: int, col: int, radius_cells: float
) -> tuple[int, int] | None:
    """Return the passable cell nearest to (row, col) within a radius, or None."""
    half = math.ceil(radius_cells)
    top, left = max(0, row - half), max(0, col - half)
    window = cell_costs[top : max(0, row + half + 1), left : max(0, col + half + 1)]
    rows, cols = np.nonzero(np.isfinite(window))
    squared = (rows + top - row) ** 2 + (cols + left - col) ** 2
    if squared.size == 0 or squared.min() > radius_cells**2:
        return None
    nearest = int(np.argmin(squared))
    return int(rows[nearest]) + top, int(cols[nearest]) + left


def find_ends(
    costmap: Costmap, cell_costs: CostArray, map_from_base: Pose2, goal: Goal, escape_radius_m: float
) -> SearchEnds | str:
    """Return the cells between which a search runs, or the reason why it cannot start.

    If the robot is too close to an obstacle, the search starts at the nearest free cell within the escape
    radius. The goal's cell may be blocked: see `nearest_reachable_goal`.
    """
    resolution_m = costmap.resolution_m
    points_m = np.array(((map_from_base.x_m, map_from_base.y_m), (goal.x_m, goal.y_m)))
    start_cells, goal_cells = (points_m - costmap.origin_m) / resolution_m
    (start_row, goal_row), (start_col, goal_col) = costmap.cells_of(points_m)
    rows, cols = cell_costs.shape
    if not (0 <= goal_row < rows and 0 <= goal_col < cols):
        return f"the goal {goal} is outside the map"
    if not (0 <= start_row < rows and 0 <= start_col < cols):
        return "the robot is outside the map"
    start = nearest_passable(cell_costs, int(start_row), int(start_col), escape_radius_m / resolution_m)
    if start is None:
        return f"the robot is inside an obstacle: no free cell within {escape_radius_m} m"
    return SearchEnds(
        start=start[0] * cols + start[1],
        goal=int(goal_row) * cols + int(goal_col),
        start_cells=start_cells,
        goal_cells=goal_cells,
        start_moved=start != (start_row, start_col),
    )


def nearest_reachable_goal(
    costmap: Costmap, cell_costs: CostArray, path_costs: FloatArray | CostArray, ends: SearchEnds, goal: Goal
) -> tuple[int, FloatArray, str] | str:
    """Return the reached cell nearest to a goal that cannot be entered, or the reason why there is none.

    `path_costs`, shape (rows * cols,), is finite where the search arrived. Returns the cell, its centre,
    shape (2,) [cells], and a message; only cells within the goal's tolerance count.
    """
    rows, cols = cell_costs.shape
    reached = np.asarray(path_costs, np.float32).reshape(rows, cols)
    row, col = divmod(ends.goal, cols)
    nearest = nearest_passable(reached, row, col, goal.tolerance_m / costmap.resolution_m)
    if nearest is None:
        blocked = not np.isfinite(cell_costs[row, col])
        where = "lies inside or too near an obstacle" if blocked else "is shut off by obstacles"
        return f"no path to the goal {goal}: it {where}"
    centre = np.array((nearest[1] + 0.5, nearest[0] + 0.5))
    x_m, y_m = costmap.origin_m + centre * costmap.resolution_m
    message = f"the goal {goal} cannot be entered: going to ({x_m:.2f}, {y_m:.2f}) instead"
    return nearest[0] * cols + nearest[1], centre, message
