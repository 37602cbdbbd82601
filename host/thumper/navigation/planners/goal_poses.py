"""The poses at a goal beside obstacles where the robot fits: the nearest one is where it is to stop."""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.common.resumable import Search, run_to_end
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import CollisionGrid, is_free
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.lattice_search import TURN_RAD

STEP_M = 0.0125
EDGE_FRACTION = 0.15  # of the tolerance, left for the robot's errors
SPARE_M = 0.015  # more room than planned motion needs ...
SPARE_WORTH_M = 0.03  # ... is worth stopping this much further from the goal
OFFSETS_RAD = TURN_RAD * np.arange(-2, 4) / 6  # between the lattice's headings, if any heading will do
HEADING_OFFSETS = (0.0, -0.3, 0.3, -0.6, 0.6)  # of the heading tolerance
DISTANCE_WEIGHT = 10.0  # free path that the robot drives to stop nearer to the goal
MOST_POSES = 1000


class GoalPoses(NamedTuple):
    """Poses at which the robot fits, nearest to the goal first."""

    poses: FloatArray  # x, y, theta, shape (n, 3); the headings differ by multiples of TURN_RAD
    costs_m: FloatArray  # what each costs [m of free path], shape (n,)


@kernel
def fitting(grid: CollisionGrid, poses: FloatArray, spare: CollisionGrid) -> FloatArray:
    """Return for each pose, shape (n, 3): 0 if it is not free, 1 if it is, 2 if it is with room to spare."""
    fits = np.zeros(poses.shape[0])
    for i in range(poses.shape[0]):
        x, y, theta = poses[i]
        if is_free(grid, x, y, theta):
            fits[i] = 2.0 if is_free(spare, x, y, theta) else 1.0
    return fits


def has_turning_room(costmap: Costmap, footprint: Footprint, goal: Goal) -> bool:
    """Return whether the robot can turn on the spot all over the middle of the goal."""
    (row,), (col,) = costmap.cells_of(np.array(((goal.x_m, goal.y_m),)))
    rows, cols = costmap.costs.shape
    if not (0 <= row < rows and 0 <= col < cols):
        return True
    room_m = math.sqrt(float(costmap.squared_cells[row, col])) * costmap.resolution_m
    return room_m > footprint.circumscribed_radius_m + 0.5 * goal.tolerance_m


def search_goal_poses(costmap: Costmap, footprint: Footprint, goal: Goal) -> Search[GoalPoses]:
    """Return the poses within the tolerances of the goal at which the footprint is free."""
    reach_m = (1.0 - EDGE_FRACTION) * goal.tolerance_m
    step_m = max(STEP_M, reach_m / 8.0)
    steps_m = step_m * np.arange(-(reach_m // step_m), reach_m // step_m + 1)
    offsets_m = np.stack(np.meshgrid(steps_m, steps_m), axis=-1).reshape(-1, 2)
    distances_m = np.hypot(*offsets_m.T)
    order = np.argsort(distances_m, kind="stable")[: np.count_nonzero(distances_m <= reach_m)]
    places_m, distances_m = offsets_m[order] + (goal.x_m, goal.y_m), distances_m[order]
    grid = CollisionGrid.from_costmap(costmap, footprint)
    spare = CollisionGrid.from_costmap(costmap, footprint.grown(SPARE_M))
    best, least_m = GoalPoses(np.empty((0, 3)), np.empty(0)), math.inf
    for offset_rad, headings_rad in _headings_rad(goal):
        poses = np.column_stack(
            (np.repeat(places_m, len(headings_rad), axis=0), np.tile(headings_rad, len(places_m)))
        )
        fits = fitting(grid, poses, spare)
        costs_m = np.repeat(distances_m, len(headings_rad)) + SPARE_WORTH_M * (fits < 2.0)
        costs_m += 0.01 * offset_rad
        free = fits > 0.0
        if free.any() and costs_m[free].min() < least_m:
            least_m = float(costs_m[free].min())
            ranked = np.flatnonzero(free)[np.argsort(costs_m[free], kind="stable")][:MOST_POSES]
            best = GoalPoses(poses[ranked], DISTANCE_WEIGHT * costs_m[ranked])
        yield
    return best


def goal_poses(costmap: Costmap, footprint: Footprint, goal: Goal) -> GoalPoses:
    """Run `search_goal_poses` at once."""
    return run_to_end(search_goal_poses(costmap, footprint, goal))


def _headings_rad(goal: Goal) -> list[tuple[float, FloatArray]]:
    """Return sets of headings that a lattice can have, and how far each is from the wanted ones [rad]."""
    if goal.theta_rad is None:
        around_rad = TURN_RAD * np.arange(round(math.tau / TURN_RAD))
        return [(0.0, around_rad + offset_rad) for offset_rad in OFFSETS_RAD]
    offsets_rad = goal.heading_tolerance_rad * np.array(HEADING_OFFSETS)
    return [(abs(offset_rad), np.array((goal.theta_rad + offset_rad,))) for offset_rad in offsets_rad]
