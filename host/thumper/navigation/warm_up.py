"""Compile the kernels before the robot moves: the first call takes seconds, later ones load a cache."""

import numpy as np

from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.goal_validation import footprint_fits
from thumper.navigation.planners.lattice import LatticePlanner


def warm_up(options: NavigationOptions | None = None, footprint: Footprint | None = None) -> None:
    """Run some cycles in a small empty map, so that no cycle on the robot waits for the compiler."""
    cells = np.zeros((80, 80), np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-2.0, origin_y_m=-2.0)
    options, footprint = options or NavigationOptions(), footprint or Footprint()
    _warm_up_rare_kernels(options, footprint, grid)
    navigator = Navigator(options, footprint)
    hits = np.array(((1.5, 1.0), (1.5, -1.0)))
    for goal in (Goal(x_m=1.0, y_m=0.2), Goal(x_m=-1.0, y_m=0.0)):
        navigator.set_goal(goal)
        for cycle in range(15):
            navigator.update(0.1 * cycle, Pose2(), Twist2(), grid, hits)


def _warm_up_rare_kernels(options: NavigationOptions, footprint: Footprint, grid: OccupancyGrid) -> None:
    """Run what a few cycles do not reach: poses through a tight passage, and whether a goal has room."""
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, options.costmap)
    goal = Goal(x_m=1.0, y_m=0.0)
    LatticePlanner(options.lattice, options.traversal, footprint).poses(costmap, Pose2(), goal)
    footprint_fits(costmap, footprint, goal)
