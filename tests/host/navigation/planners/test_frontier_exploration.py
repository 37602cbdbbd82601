"""Frontiers: where they are, when they are seen, each tried once, and from where the robot observes them."""

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


def test_explorer_skips_what_it_has_tried() -> None:
    explorer = Explorer(ExplorationOptions(), Footprint())
    start = Pose2(x_m=1.0, y_m=2.0)
    frontier = run_to_end(explorer.search(two_rooms(100), start))
    assert frontier is not None
    explorer.skip(frontier)
    assert run_to_end(explorer.search(two_rooms(100), start)) is None
    explorer.retry([frontier])
    assert run_to_end(explorer.search(two_rooms(100), start)) == frontier


@pytest.mark.parametrize(("seen", "is_seen"), [(100, False), (101, True), (160, True)])
def test_frontier_is_seen_once_the_space_behind_it_is_known(seen: int, is_seen: bool) -> None:
    (frontier,) = find_frontiers(two_rooms(100), Pose2(x_m=1.0, y_m=2.0), Footprint(), ExplorationOptions())
    assert frontier.is_seen(two_rooms(seen)) is is_seen
    grown = two_rooms(seen).including(-2.0, -3.0, 1.0)  # the cells have other indices now
    assert frontier.is_seen(grown) is is_seen


def test_frontier_of_which_half_is_seen() -> None:
    grid = two_rooms(100)
    (frontier,) = find_frontiers(grid, Pose2(x_m=1.0, y_m=2.0), Footprint(), ExplorationOptions())
    grid.cells[:35, 100:] = 0
    assert not frontier.is_seen(grid)
    grid.cells[:45, 100:] = 0
    assert frontier.is_seen(grid)


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
    explorer = Explorer(options, footprint)
    chosen = run_to_end(explorer.search(grid, start))
    assert chosen is not None
    goal = explorer.goal(chosen)
    assert (goal.x_m, goal.y_m) == recess.viewpoint_m
    assert goal.theta_rad == pytest.approx(0.0, abs=0.3)  # it faces the recess
    cells[:26, 1:50] = cells[34:, 1:50] = 100  # now all of it is as narrow: no room anywhere
    (ahead,) = find_frontiers(grid, Pose2(x_m=1.0, y_m=1.5), footprint, options)
    assert ahead.viewpoint_m == (ahead.x_m, ahead.y_m)
