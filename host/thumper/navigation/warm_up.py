"""Compile the kernels before the robot moves: the first call takes seconds, later ones load a cache."""

from dataclasses import replace

import numpy as np

from thumper.common.geometry import Pose2, Twist2
from thumper.common.resumable import run_to_end
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.costmap.costmap import Costmap, build_costmap, part_of, square_around
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, find_frontiers
from thumper.navigation.planners.goal_poses import goal_poses
from thumper.navigation.planners.goal_validation import footprint_fits
from thumper.navigation.planners.homotopy import is_same_side
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.safety.collision_monitor import CollisionMonitor
from thumper.navigation.safety.escape import Escape
from thumper.navigation.safety.give_way import GiveWay
from thumper.navigation.safety.tracks import STEPS

SIDE = 80  # cells


def warm_up(options: NavigationOptions | None = None, footprint: Footprint | None = None) -> None:
    """Run some cycles in a small empty map, so that no cycle on the robot waits for the compiler."""
    cells = np.zeros((SIDE, SIDE), np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-2.0, origin_y_m=-2.0)
    options, footprint = options or NavigationOptions(), footprint or Footprint()
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, options.costmap)
    _warm_up_planning(options, footprint, grid, costmap)
    _warm_up_safety(options, footprint, costmap)
    hits = np.array(((1.5, 1.0), (1.5, -1.0)))
    for tracker in {options.tracker, ""}:  # the controller drives where the tracker has no room
        navigator = Navigator(replace(options, tracker=tracker), footprint)
        for goal in (Goal(x_m=1.0, y_m=0.2), Goal(x_m=-1.0, y_m=0.0)):
            navigator.set_goal(goal)
            for cycle in range(3):
                navigator.update(0.1 * cycle, Pose2(), Twist2(), grid, hits)


def _warm_up_planning(
    options: NavigationOptions, footprint: Footprint, grid: OccupancyGrid, costmap: Costmap
) -> None:
    """Plan poses through a tight passage, compare paths, look for room at a goal and for frontiers."""
    goal = Goal(x_m=1.0, y_m=0.0)
    lattice = LatticePlanner(options.lattice, options.traversal, footprint)
    lattice.poses(costmap, Pose2(), goal)
    run_to_end(lattice.search_poses_to(costmap, costmap, Pose2(), *goal_poses(costmap, footprint, goal)))
    is_same_side(np.zeros((2, 2)), np.ones((2, 2)), costmap)
    lattice.path_cost_m(costmap, np.zeros((2, 2)))
    part = part_of(costmap, *square_around(costmap, 0.0, 0.0, 1.0))
    for known in (costmap, part, replace(part, costs=part.costs.copy())):  # three memory layouts
        footprint_fits(known, footprint, goal)
    half_known = np.where(np.arange(SIDE) < 0.7 * SIDE, grid.cells, -1).astype(np.int8)
    find_frontiers(replace(grid, cells=half_known), Pose2(), footprint, ExplorationOptions())


def _warm_up_safety(options: NavigationOptions, footprint: Footprint, costmap: Costmap) -> None:
    """Slow down before an obstacle, get away from it, and give way to a person."""
    monitor = CollisionMonitor(options.monitor, options.limits, footprint)
    ahead_m = np.array(((0.3, 0.0), (0.3, 0.1)))
    monitor.slow_down(Twist2(v_m_s=0.4), ahead_m)
    request = ControlRequest(
        map_from_base=Pose2(),
        twist=Twist2(),
        last_command=Twist2(),
        path_m=np.array(((0.0, 0.0), (1.0, 0.0))),
        costmap=costmap,
        v_limit_m_s=0.4,
        period_s=0.1,
    )
    Escape(monitor, options.limits, footprint).compute_command(request, ahead_m, np.zeros(len(ahead_m)))
    give_way, person = GiveWay(options.limits, footprint, margin_m=0.1), np.full((STEPS, 1, 3), 0.5)
    give_way.is_in_conflict(Twist2(v_m_s=0.4), request, person)
    give_way.best_command(request, person, lambda command: command)
