"""Compile the kernels before the robot moves: the first call takes seconds, later ones load a cache."""

import numpy as np

from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.navigation.options import NavigationOptions


def warm_up(options: NavigationOptions | None = None, footprint: Footprint | None = None) -> None:
    """Run some cycles in a small empty map, so that no cycle on the robot waits for the compiler."""
    cells = np.zeros((80, 80), np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-2.0, origin_y_m=-2.0)
    navigator = Navigator(options or NavigationOptions(), footprint or Footprint())
    hits = np.array(((1.5, 1.0), (1.5, -1.0)))
    for goal in (Goal(x_m=1.0, y_m=0.2), Goal(x_m=-1.0, y_m=0.0)):
        navigator.set_goal(goal)
        for cycle in range(15):
            navigator.update(0.1 * cycle, Pose2(), Twist2(), grid, hits)
