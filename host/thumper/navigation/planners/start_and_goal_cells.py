"""Convert a pose and a goal to the cells between which a search runs, or report why it cannot."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.texts import place_text
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.cell_costs import CellCosts, cost_at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchEnds:
    """Start and goal on a grid: flat cell indices, and points, shape (2,) [cells]."""

    start: int
    goal: int
    start_cells: FloatArray
    goal_cells: FloatArray
    start_moved: bool  # the search starts at the nearest free cell instead of at the robot


def nearest_passable(
    cells: CellCosts,
    row: int,
    col: int,
    radius_cells: float,
    reached: NDArray[np.bool_] | None = None,
) -> tuple[int, int] | None:
    """Return the passable cell nearest to (row, col) within a radius, or None.

    Only cells that are `reached`, shape (rows, cols), count; None: all.
    """
    half = math.ceil(radius_cells)
    top, left = max(0, row - half), max(0, col - half)
    bottom, right = min(cells.costs.shape[0], row + half + 1), min(cells.costs.shape[1], col + half + 1)
    window = slice(top, max(top, bottom)), slice(left, max(left, right))
    passable = np.isfinite(cells.part(*window))
    if reached is not None:
        passable &= reached[window]
    rows, cols = np.nonzero(passable)
    squared = (rows + top - row) ** 2 + (cols + left - col) ** 2
    if squared.size == 0 or squared.min() > radius_cells**2:
        return None
    nearest = int(np.argmin(squared))
    return int(rows[nearest]) + top, int(cols[nearest]) + left


def find_ends(
    costmap: Costmap, cells: CellCosts, map_from_base: Pose2, goal: Goal, escape_radius_m: float
) -> SearchEnds | str:
    """Return the cells between which a search runs, or the reason why it cannot start.

    If the robot is too close to an obstacle, the search starts at the nearest free cell within the escape
    radius. The goal's cell may be blocked: see `goal_end`.
    """
    resolution_m = costmap.resolution_m
    points_m = np.array(((map_from_base.x_m, map_from_base.y_m), (goal.x_m, goal.y_m)))
    start_cells, goal_cells = (points_m - costmap.origin_m) / resolution_m
    (start_row, goal_row), (start_col, goal_col) = costmap.cells_of(points_m)
    rows, cols = cells.costs.shape
    if not (0 <= goal_row < rows and 0 <= goal_col < cols):
        return f"the goal {goal} is outside the map"
    if not (0 <= start_row < rows and 0 <= start_col < cols):
        return "the start of the path is outside the map"
    start = nearest_passable(cells, int(start_row), int(start_col), escape_radius_m / resolution_m)
    if start is None:
        return f"the robot is inside an obstacle: no free cell within {escape_radius_m} m"
    return SearchEnds(
        start=start[0] * cols + start[1],
        goal=int(goal_row) * cols + int(goal_col),
        start_cells=start_cells,
        goal_cells=goal_cells,
        start_moved=start != (start_row, start_col),
    )


class GoalEnd(NamedTuple):
    """Where a path to a goal ends."""

    cell: int  # flat index
    point_cells: FloatArray  # shape (2,)
    message: str  # why it is not the goal itself; empty if it is


def goal_end(
    costmap: Costmap,
    cells: CellCosts,
    ends: SearchEnds,
    goal: Goal,
    reached: NDArray[np.bool_] | None = None,
) -> GoalEnd | str:
    """Return the goal's cell, or the nearest one within the tolerance; or the reason why there is none.

    Only cells that can be entered count and, after a search, only those that it has `reached`, shape
    (rows * cols,).
    """
    rows, cols = cells.costs.shape
    row, col = divmod(ends.goal, cols)
    is_blocked = not np.isfinite(cost_at(cells, row, col))
    if not is_blocked and (reached is None or reached[ends.goal]):
        return GoalEnd(ends.goal, ends.goal_cells, "")
    radius_cells = goal.tolerance_m / costmap.resolution_m
    within = None if reached is None else reached.reshape(rows, cols)
    nearest = nearest_passable(cells, row, col, radius_cells, within)
    if nearest is None:
        where = "lies inside or too near an obstacle" if is_blocked else "is shut off by obstacles"
        return f"no path to the goal {goal}: it {where}"
    centre = np.array((nearest[1] + 0.5, nearest[0] + 0.5))
    x_m, y_m = costmap.origin_m + centre * costmap.resolution_m
    message = f"the goal {goal} cannot be entered: going to {place_text(x_m, y_m)} instead"
    return GoalEnd(nearest[0] * cols + nearest[1], centre, message)
