"""From a pose and a goal to the cells that a search begins and ends at, or why there are none."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar_search import CostArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchEnds:
    """Start and goal on a grid: flat indices of cells, and points, shape (2,) [cells]."""

    start: int
    goal: int
    start_cells: FloatArray
    goal_cells: FloatArray
    start_moved: bool  # the search begins at the nearest free cell, not where the robot stands


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


def locate(
    costmap: Costmap, prices: CostArray, map_from_base: Pose2, goal: Goal, escape_radius_m: float
) -> SearchEnds | str:
    """Where a search begins and ends; or, in words, why it cannot begin.

    A robot that stands too near an obstacle begins at the nearest free cell within the escape radius. The
    goal's cell may be blocked: see `substitute`.
    """
    resolution_m = costmap.resolution_m
    points_m = np.array(((map_from_base.x_m, map_from_base.y_m), (goal.x_m, goal.y_m)))
    start_cells, goal_cells = (points_m - costmap.origin_m) / resolution_m
    (start_row, goal_row), (start_col, goal_col) = costmap.cells_of(points_m)
    rows, cols = prices.shape
    if not (0 <= goal_row < rows and 0 <= goal_col < cols):
        return f"the goal {goal} is outside the map"
    if not (0 <= start_row < rows and 0 <= start_col < cols):
        return "the robot is outside the map"
    start = nearest_open(prices, int(start_row), int(start_col), escape_radius_m / resolution_m)
    if start is None:
        return f"the robot stands inside an obstacle: no free cell within {escape_radius_m} m"
    return SearchEnds(
        start=start[0] * cols + start[1],
        goal=int(goal_row) * cols + int(goal_col),
        start_cells=start_cells,
        goal_cells=goal_cells,
        start_moved=start != (start_row, start_col),
    )


def substitute(
    costmap: Costmap, prices: CostArray, reached: FloatArray | CostArray, ends: SearchEnds, goal: Goal
) -> tuple[int, FloatArray, str] | str:
    """The reached cell nearest to a goal that cannot be, within its tolerance; or, in words, why there is
    none.

    `reached`, shape (rows * cols,), is finite where the search came. Returns the cell, its centre, shape (2,)
    [cells], and what to tell.
    """
    rows, cols = prices.shape
    field = np.asarray(reached, np.float32).reshape(rows, cols)
    row, col = divmod(ends.goal, cols)
    nearest = nearest_open(field, row, col, goal.tolerance_m / costmap.resolution_m)
    if nearest is None:
        blocked = not np.isfinite(prices[row, col])
        where = "lies inside or too near an obstacle" if blocked else "is shut off by obstacles"
        return f"no way to the goal {goal}: it {where}"
    centre = np.array((nearest[1] + 0.5, nearest[0] + 0.5))
    x_m, y_m = costmap.origin_m + centre * costmap.resolution_m
    told = f"the goal {goal} cannot be entered: going to ({x_m:.2f}, {y_m:.2f}) instead"
    return nearest[0] * cols + nearest[1], centre, told
