"""Whether the robot fits at its goal at all: some goals nobody could reach."""

import itertools
import math

import numpy as np

from thumper.navigation.costmap import Costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.inflation import LETHAL

HEADINGS = 16


def has_room(costmap: Costmap, footprint: Footprint, goal: Goal) -> bool:
    """Whether no obstacle is in the outline at some place within the tolerance, under some heading."""
    rows, cols = np.nonzero(costmap.costs == LETHAL)
    obstacles_m = costmap.origin_m + (np.column_stack((cols, rows)) + 0.5) * costmap.resolution_m
    obstacles_m -= (goal.x_m, goal.y_m)
    reach_m = footprint.circumscribed_radius_m + goal.tolerance_m
    obstacles_m = obstacles_m[np.hypot(*obstacles_m.T) < reach_m]
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
