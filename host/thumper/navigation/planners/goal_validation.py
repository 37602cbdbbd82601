"""Reject a goal that the robot cannot reach before it moves."""

import math
from dataclasses import replace

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import (
    Costmap,
    CostmapOptions,
    build_costmap,
    inflation_radius_cells,
)
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.costmap.inflation import UNKNOWN
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.start_and_goal_cells import nearest_passable

HEADINGS = 16
NEAREST_PLACES, OTHER_PLACES = 200, 200  # most places that are checked within the tolerance


def footprint_fits(costmap: Costmap, footprint: Footprint, goal: Goal) -> bool:
    """Return whether the footprint is free of obstacles at some pose within the tolerances of the goal.

    Checks the cells nearest to the goal and, if the tolerance is large, an even choice of the others.
    """
    grid = CollisionGrid.from_costmap(costmap, footprint)
    grid = grid._replace(outline=filled(footprint, 0.5 * costmap.resolution_m))
    headings_rad: FloatArray = math.tau / HEADINGS * np.arange(HEADINGS, dtype=np.float64)
    if goal.theta_rad is not None:
        headings_rad = goal.theta_rad + goal.heading_tolerance_rad * np.linspace(-1.0, 1.0, 5)
    return any_pose_is_free(grid, _places_m(costmap.resolution_m, goal), headings_rad)


@kernel
def any_pose_is_free(grid: CollisionGrid, places_m: FloatArray, headings_rad: FloatArray) -> bool:
    """Return whether the footprint is free of obstacles at one of the places, shape (n, 2)."""
    for i in range(places_m.shape[0]):
        for heading in headings_rad:
            if lethal_count(grid, False, places_m[i, 0], places_m[i, 1], heading) <= 0:
                return True
    return False


def filled(footprint: Footprint, spacing_m: float) -> FloatArray:
    """Return points all over the footprint, at most `spacing_m` apart, shape (n, 2) [m]."""
    outline_m = footprint.outline_m(spacing_m)
    x_m, y_m = (
        np.arange(lo, hi, spacing_m) for lo, hi in zip(outline_m.min(0), outline_m.max(0), strict=True)
    )
    inner_m = np.stack(np.meshgrid(x_m, y_m), axis=-1).reshape(-1, 2)
    planes = footprint.half_planes()
    return np.vstack((outline_m, inner_m[(inner_m @ planes[:, :2].T < planes[:, 2]).all(axis=1)]))


def _places_m(resolution_m: float, goal: Goal) -> FloatArray:
    """Return places a cell apart within the tolerance of the goal, nearest first, shape (n, 2) [m]."""
    steps = resolution_m * np.arange(
        -(goal.tolerance_m // resolution_m), goal.tolerance_m // resolution_m + 1
    )
    offsets_m = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    distances_m = np.hypot(*offsets_m.T)
    order = np.argsort(distances_m, kind="stable")[: np.count_nonzero(distances_m <= goal.tolerance_m)]
    others = order[NEAREST_PLACES:]
    order = np.concatenate((order[:NEAREST_PLACES], others[:: max(1, math.ceil(len(others) / OTHER_PLACES))]))
    return np.ascontiguousarray(offsets_m[order] + np.array((goal.x_m, goal.y_m)))


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
            f"goal {goal} is outside the map (x {grid.origin_x_m:z.2f} to {x_end_m:z.2f} m, "
            f"y {grid.origin_y_m:z.2f} to {y_end_m:z.2f} m): choose a goal inside it or a larger map"
        )
    given = options or CostmapOptions()
    radius_cells = goal.tolerance_m / grid.resolution_m
    reach = math.ceil(radius_cells) + inflation_radius_cells(footprint, given, grid.resolution_m) + 2
    top, left = max(0, row - reach), max(0, col - reach)
    around = replace(grid, cells=grid.cells[top : row + reach + 1, left : col + reach + 1])
    costmap, row, col = build_costmap(around, np.empty((0, 2)), footprint, given), row - top, col - left
    if nearest_passable(planner.cell_costs(costmap), row, col, radius_cells) is not None:
        return
    if costmap.costs[row, col] == UNKNOWN:
        raise ThumperError(
            f"goal {goal} is in unknown space, which the planner must not enter: choose a goal in known "
            "space or set [navigation.traversal] allow_unknown = true"
        )
    raise ThumperError(
        f"goal {goal} is inside or too near an obstacle or a keep-out zone: choose a goal at least "
        f"{footprint.inscribed_radius_m:.2f} m away"
    )
