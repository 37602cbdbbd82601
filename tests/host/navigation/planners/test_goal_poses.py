"""Poses at a goal beside a wall, and the way there."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.common.resumable import run_to_end
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.goal_poses import (
    OFFSETS_RAD,
    goal_poses,
    has_turning_room,
    search_goal_poses,
)
from thumper.navigation.planners.goal_validation import footprint_fits
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions

WALL_Y_M = -1.0  # the wall's surface, along x


@pytest.fixture
def beside_wall() -> Costmap:
    cells = np.zeros((160, 160), np.int8)
    cells[:40] = 100
    grid = OccupancyGrid(cells=cells, resolution_m=0.025, origin_x_m=-2.0, origin_y_m=-2.0)
    return build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())


def test_robot_stands_along_the_wall_as_near_to_the_goal_as_it_fits(beside_wall: Costmap) -> None:
    poses, costs_m = goal_poses(beside_wall, Footprint(), Goal(x_m=0.0, y_m=WALL_Y_M + 0.12))
    x_m, y_m, theta_rad = poses[0]
    assert abs(x_m) < 0.03
    assert WALL_Y_M + 0.15 <= y_m < WALL_Y_M + 0.18
    assert abs(math.sin(theta_rad)) < 0.1
    assert np.all(np.diff(costs_m) >= 0.0)


def test_no_pose_fits_with_the_nose_in_the_wall(beside_wall: Costmap) -> None:
    """0.12 m from the wall there is room along it, not toward it."""
    goal = Goal(x_m=0.0, y_m=WALL_Y_M + 0.10, theta_rad=-0.5 * math.pi)
    assert len(goal_poses(beside_wall, Footprint(), goal).poses) == 0
    assert not footprint_fits(beside_wall, Footprint(), goal)
    assert footprint_fits(beside_wall, Footprint(), Goal(x_m=0.0, y_m=WALL_Y_M + 0.10))


def test_heading_stays_within_the_goals_tolerance(beside_wall: Costmap) -> None:
    goal = Goal(x_m=0.0, y_m=WALL_Y_M + 0.16, theta_rad=0.12)
    poses, _ = goal_poses(beside_wall, Footprint(), goal)
    assert len(poses) > 0
    assert np.abs(poses[:, 2] - 0.12).max() <= goal.heading_tolerance_rad


@pytest.mark.parametrize(("wall_m", "room"), [(0.20, False), (0.45, True)])
def test_room_to_turn(beside_wall: Costmap, wall_m: float, room: bool) -> None:
    goal = Goal(x_m=0.0, y_m=WALL_Y_M + wall_m)
    assert has_turning_room(beside_wall, Footprint(), goal) is room


def test_poses_lead_exactly_to_one_of_the_ends(beside_wall: Costmap) -> None:
    """From the middle of the room to the wall; the last pose is an end, the first is near the robot."""
    lattice = LatticePlanner(LatticeOptions(), TraversalCostOptions(), Footprint())
    ends, costs_m = goal_poses(beside_wall, Footprint(), Goal(x_m=0.5, y_m=WALL_Y_M + 0.12))
    poses = run_to_end(lattice.search_poses_to(beside_wall, beside_wall, Pose2(y_m=-0.2), ends, costs_m))
    assert len(poses) > 2
    assert math.hypot(poses[0, 0], poses[0, 1] + 0.2) < 0.06
    offsets = ends - poses[-1]
    offsets[:, 2] = np.angle(np.exp(1j * offsets[:, 2]))
    assert np.abs(offsets).max(axis=1).min() < 1e-6
    forward_m = np.sum(
        np.diff(poses[:, :2], axis=0) * np.column_stack((np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2]))),
        axis=1,
    )
    assert forward_m.sum() > 0.5  # in the order of the motion, nose first


def test_way_to_a_goal_grazes_no_wall_where_there_is_room(beside_wall: Costmap) -> None:
    """The robot is to stand with its tail at the wall: it turns further away from it and backs up."""
    lattice = LatticePlanner(LatticeOptions(), TraversalCostOptions(), Footprint())
    end = np.array(((0.8, WALL_Y_M + 0.19, 0.5 * math.pi),))
    start = Pose2(x_m=-0.2, y_m=-0.65)
    poses = run_to_end(lattice.search_poses_to(beside_wall, beside_wall, start, end, np.zeros(1)))
    roomy = CollisionGrid.from_costmap(beside_wall, Footprint().grown(0.025))
    assert len(poses) > 5
    assert not [pose for pose in poses[:-1] if lethal_count(roomy, False, *pose) > 0]


def test_the_sets_of_headings_are_searched_one_by_one(beside_wall: Costmap) -> None:
    """All of them at once would take longer than a control cycle allows."""
    goal = Goal(x_m=0.0, y_m=WALL_Y_M + 0.12)
    assert sum(1 for _ in search_goal_poses(beside_wall, Footprint(), goal)) == len(OFFSETS_RAD)
