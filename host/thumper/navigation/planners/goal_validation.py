"""Reject a goal that the robot cannot reach before it moves."""

import itertools
import math

import numpy as np

from thumper.common.errors import ThumperError
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.costmap.inflation import LETHAL, UNKNOWN
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.start_and_goal_cells import nearest_passable

HEADINGS = 16


def footprint_fits(costmap: Costmap, footprint: Footprint, goal: Goal) -> bool:
    """Return whether the footprint is free of obstacles at some pose within the tolerance of the goal."""
    rows, cols = np.nonzero(costmap.costs == LETHAL)
    obstacles_m = costmap.origin_m + (np.column_stack((cols, rows)) + 0.5) * costmap.resolution_m
    obstacles_m -= (goal.x_m, goal.y_m)
    radius_m = footprint.circumscribed_radius_m + goal.tolerance_m
    obstacles_m = obstacles_m[np.hypot(*obstacles_m.T) < radius_m]
    planes = footprint.half_planes()
    tolerance_cells = math.floor(goal.tolerance_m / costmap.resolution_m)
    steps = range(-tolerance_cells, tolerance_cells + 1)
    for k, row, col in itertools.product(range(HEADINGS), steps, steps):
        place_m = costmap.resolution_m * np.array((col, row))
        if math.hypot(*place_m) > goal.tolerance_m:
            continue
        cos, sin = math.cos(2.0 * math.pi * k / HEADINGS), math.sin(2.0 * math.pi * k / HEADINGS)
        in_base_m = (obstacles_m - place_m) @ np.array(((cos, -sin), (sin, cos)))
        inside_m = planes[:, 2] - in_base_m @ planes[:, :2].T
        if not np.any(np.all(inside_m > 0.0, axis=1)):
            return True
    return False


def validate_goal(
    goal: Goal,
    grid: OccupancyGrid,
    footprint: Footprint,
    planner: Planner,
    options: CostmapOptions | None = None,
) -> None:
    """Check that the planner could end a path at a goal, by the map known so far.

    Raises
    ------
    ThumperError
        The goal is outside the map, or the planner may enter no cell within its tolerance: they are too near
        an obstacle, or unknown and unknown space is not allowed.
    """
    row, col = grid.cell_of(goal.x_m, goal.y_m)
    rows, cols = grid.cells.shape
    if not grid.contains(row, col):
        x_end_m = grid.origin_x_m + cols * grid.resolution_m
        y_end_m = grid.origin_y_m + rows * grid.resolution_m
        raise ThumperError(
            f"goal {goal} is outside the map (x {grid.origin_x_m:.2f} to {x_end_m:.2f} m, "
            f"y {grid.origin_y_m:.2f} to {y_end_m:.2f} m): choose a goal inside it or a larger map"
        )
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, options or CostmapOptions())
    radius_cells = goal.tolerance_m / grid.resolution_m
    if nearest_passable(planner.cell_costs(costmap), row, col, radius_cells) is not None:
        return
    if costmap.costs[row, col] == UNKNOWN:
        raise ThumperError(
            f"goal {goal} is in unknown space, which the planner must not enter: choose a goal in known "
            "space or set [navigation.traversal] allow_unknown = true"
        )
    raise ThumperError(
        f"goal {goal} is inside or too near an obstacle: choose a goal at least "
        f"{footprint.inscribed_radius_m:.2f} m from obstacles"
    )
