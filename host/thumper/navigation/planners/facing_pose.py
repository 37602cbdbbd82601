"""A pose in front of something, from which the robot faces it."""

import math
from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap, inflation_radius_cells
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.goal_validation import filled

CLEARANCES_M = (0.3, 0.5, 0.7)  # between the robot's front and the thing, the preferred one first
STEP_RAD, STEPS = math.radians(15.0), 5  # to either side
MARGIN_M = 0.05  # round the robot
EDGE_M = 0.15  # before the thing, where its own cells may begin


def facing_pose(
    thing: Pose2, grid: OccupancyGrid, hits_in_map_m: FloatArray, footprint: Footprint
) -> Pose2 | None:
    """Return a pose in known free space that faces a thing, with nothing between; None if there is none.

    `thing` looks where the robot should stand; poses up to 75 degrees beside that direction will do.
    `hits_in_map_m`, shape (n, 2), are obstacles that may not be in the map yet.
    """
    options = CostmapOptions()
    front_m = float(footprint.polygon_m()[:, 0].max())
    farthest_m = front_m + max(CLEARANCES_M) + footprint.circumscribed_radius_m + MARGIN_M
    reach = math.ceil(farthest_m / grid.resolution_m) + inflation_radius_cells(
        footprint, options, grid.resolution_m
    )
    around = _around(grid, thing, reach)
    if not around.cells.size:
        return None
    costmap = build_costmap(around, hits_in_map_m, footprint, options)
    grown = footprint.grown(MARGIN_M)
    collisions = CollisionGrid.from_costmap(costmap, grown)
    body_m = filled(grown, 0.5 * grid.resolution_m)  # a small obstacle may lie inside the outline
    for turn in sorted(range(-STEPS, STEPS + 1), key=abs):
        direction_rad = thing.theta_rad + turn * STEP_RAD
        for clearance_m in CLEARANCES_M:
            away = Pose2(x_m=thing.x_m, y_m=thing.y_m, theta_rad=direction_rad)
            pose = away @ Pose2(x_m=front_m + clearance_m, theta_rad=math.pi)
            view_m = np.arange(front_m, front_m + clearance_m - EDGE_M, 0.5 * grid.resolution_m)
            shape_m = np.vstack((body_m, np.column_stack((view_m, np.zeros(view_m.size)))))
            collisions = collisions._replace(outline=shape_m)
            if lethal_count(collisions, True, pose.x_m, pose.y_m, pose.theta_rad) == 0:
                return pose
    return None


def _around(grid: OccupancyGrid, centre: Pose2, reach: int) -> OccupancyGrid:
    """Return the part of a grid within `reach` cells."""
    row, column = grid.cell_of(centre.x_m, centre.y_m)
    top, left = max(0, row - reach), max(0, column - reach)
    part = np.s_[top : max(top, row + reach + 1), left : max(left, column + reach + 1)]
    return replace(
        grid,
        cells=grid.cells[part],
        origin_x_m=grid.origin_x_m + left * grid.resolution_m,
        origin_y_m=grid.origin_y_m + top * grid.resolution_m,
    )
