"""Frontiers: where they are, each tried once, and from where the robot observes them."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.common.resumable import run_to_end
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer, find_frontiers

RADIUS_M = Footprint().circumscribed_radius_m


def two_rooms(seen: int) -> OccupancyGrid:
    """Return two rooms with a door; columns from `seen` on are unknown."""
    cells = np.zeros((80, 160), np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    cells[:, 80] = 100
    cells[30:50, 80] = 0
    cells[:, seen:] = -1
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)


def test_frontiers_are_where_known_free_space_ends() -> None:
    start, options = Pose2(x_m=1.0, y_m=2.0), ExplorationOptions()
    found = find_frontiers(two_rooms(100), start, Footprint(), options)
    assert len(found) == 1
    assert found[0].x_m == pytest.approx(4.975, abs=0.051)
    assert found[0].path_cost_m > 3.9
    assert find_frontiers(two_rooms(160), start, Footprint(), options) == []


def test_explorer_tries_each_frontier_once() -> None:
    explorer = Explorer(ExplorationOptions(), Footprint())
    start = Pose2(x_m=1.0, y_m=2.0)
    assert run_to_end(explorer.search(two_rooms(100), start)) is not None
    assert run_to_end(explorer.search(two_rooms(100), start)) is None


def test_frontier_in_a_recess_is_observed_from_where_the_robot_can_turn() -> None:
    """A recess 0.4 m wide, its end unknown: the centre may enter, but there is no room to turn."""
    cells = np.full((60, 80), 100, np.int8)
    cells[1:-1, 1:50] = 0
    cells[26:34, 50:56], cells[26:34, 56:79] = 0, -1
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    start, footprint = Pose2(x_m=1.0, y_m=1.0), Footprint()
    (recess,) = find_frontiers(grid, start, footprint, ExplorationOptions(least_frontier_m=0.1))
    assert recess.x_m > 2.7
    options = ExplorationOptions(least_frontier_m=0.1)
    assert math.dist(recess.viewpoint_m, (recess.x_m, recess.y_m)) < 1.0
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
    ((row,), (col,)) = costmap.cells_of(np.array((recess.viewpoint_m,)))
    assert math.sqrt(costmap.squared_cells[row, col]) * 0.05 > RADIUS_M
    goal = run_to_end(Explorer(options, footprint).search(grid, start))
    assert goal is not None
    assert (goal.x_m, goal.y_m) == recess.viewpoint_m
    assert goal.theta_rad == pytest.approx(0.0, abs=0.3)  # it faces the recess
    cells[:26, 1:50] = cells[34:, 1:50] = 100  # now all of it is as narrow: no room anywhere
    (ahead,) = find_frontiers(grid, Pose2(x_m=1.0, y_m=1.5), footprint, options)
    assert ahead.viewpoint_m == (ahead.x_m, ahead.y_m)
