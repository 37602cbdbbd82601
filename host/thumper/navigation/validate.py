"""Refuse a senseless goal before the robot moves."""

import numpy as np

from thumper.errors import ThumperError
from thumper.mapping.grid import OccupancyGrid
from thumper.navigation.astar import AStarOptions, cell_prices
from thumper.navigation.costmap import CostmapOptions, build_costmap
from thumper.navigation.endpoints import nearest_open
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal


def validate_goal(
    goal: Goal, grid: OccupancyGrid, footprint: Footprint, options: CostmapOptions | None = None
) -> None:
    """Check a goal against the map known so far; unknown ground is fine.

    Raises
    ------
    ThumperError
        The goal is outside the map, or so near an obstacle that no place within its tolerance can hold the
        robot.
    """
    row, col = grid.cell_of(goal.x_m, goal.y_m)
    rows, cols = grid.cells.shape
    if not grid.contains(row, col):
        x_end_m, y_end_m = (
            grid.origin_x_m + cols * grid.resolution_m,
            grid.origin_y_m + rows * grid.resolution_m,
        )
        raise ThumperError(
            f"goal {goal} is outside the map (x {grid.origin_x_m:.2f} to {x_end_m:.2f} m, "
            f"y {grid.origin_y_m:.2f} to {y_end_m:.2f} m): choose a goal inside it or a larger map"
        )
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, options or CostmapOptions())
    if (
        nearest_open(cell_prices(costmap, AStarOptions()), row, col, goal.tolerance_m / grid.resolution_m)
        is None
    ):
        raise ThumperError(
            f"goal {goal} is inside or too near an obstacle: choose a goal at least "
            f"{footprint.inscribed_radius_m:.2f} m from obstacles"
        )
