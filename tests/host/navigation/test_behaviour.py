"""Slow zone, smoother, memory, transitions, give-up and exploration, each alone or in a closed loop."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.obstacle_memory import (
    MOST_SPREAD_M,
    SPREAD_PART,
    ObstacleMemory,
    ObstacleMemoryOptions,
)
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer, find_frontiers
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits

FRONT_M = 0.21
HULL_M = Footprint().circumscribed_radius_m


@pytest.mark.parametrize(("gap_m", "part"), [(0.10, 0.4), (0.24, 0.6), (0.36, 0.9), (0.6, 1.0)])
def test_the_slow_zone_shrinks_both_speeds_by_the_time_to_contact(gap_m: float, part: float) -> None:
    monitor = CollisionMonitor(CollisionMonitorOptions(), SpeedLimits(), Footprint())
    slow = monitor.slowed(Twist2(v_m_s=0.4), np.array(((FRONT_M + gap_m, 0.0),)))
    assert slow.v_m_s == pytest.approx(part * 0.4, abs=0.06 * 0.4)
    bent = monitor.slowed(Twist2(v_m_s=0.4, w_rad_s=0.2), np.array(((FRONT_M + gap_m, 0.0),)))
    assert bent.w_rad_s == pytest.approx(0.5 * bent.v_m_s)


def test_the_smoother_keeps_the_accelerations() -> None:
    limits, twist = SpeedLimits(), Twist2()
    for _ in range(30):
        after = smooth_velocity(Twist2(v_m_s=9.0, w_rad_s=-9.0), twist, limits, 0.1)
        assert after.v_m_s - twist.v_m_s <= limits.v_accel_m_s2 * 0.1 + 1e-12
        assert twist.w_rad_s - after.w_rad_s <= limits.w_accel_rad_s2 * 0.1 + 1e-12
        twist = after
    assert (twist.v_m_s, twist.w_rad_s) == (limits.v_max_m_s, -limits.w_max_rad_s)
    assert smooth_velocity(Twist2(v_m_s=0.001), Twist2(), limits, 0.1) == Twist2()


def ring(radius_m: float) -> FloatArray:
    angles_rad = np.linspace(-2.0, 2.0, 400)
    return np.column_stack((radius_m * np.cos(angles_rad), radius_m * np.sin(angles_rad)))


def test_memory_keeps_what_is_hidden_and_clears_what_a_ray_passes() -> None:
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), HULL_M)
    post = np.array(((0.5, 0.0),))
    assert len(memory.update(0.0, Pose2(), post)) == 0  # seen now: nothing to add
    assert memory.update(0.1, Pose2(theta_rad=math.pi), np.empty((0, 2))) == pytest.approx(post)  # behind
    assert memory.update(0.2, Pose2(), np.array(((0.3, 0.0),))) == pytest.approx(post)  # hidden by another
    assert len(memory.update(0.3, Pose2(), ring(2.0))) == 0  # rays pass
    memory.update(1.0, Pose2(), post)
    assert len(memory.update(30.0, Pose2(theta_rad=math.pi), np.empty((0, 2)))) == 0  # too long ago
    memory.update(31.0, Pose2(), np.vstack((post, ((0.25, 0.2),))))
    memory.forget_beyond(Pose2(), 0.4)
    left = memory.update(31.1, Pose2(theta_rad=math.pi), np.empty((0, 2)))
    assert left == pytest.approx(np.array(((0.25, 0.2),)))


def test_what_is_beside_the_hull_is_kept_however_long_the_robot_stands() -> None:
    """A robot that stood for half a minute beside a post behind it once forgot it, and swung into it."""
    memory, turned = (
        ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), HULL_M),
        Pose2(theta_rad=3.0),
    )
    post, further = np.array(((HULL_M + 0.05, 0.0),)), np.array(((HULL_M + 0.30, 0.1),))
    memory.update(0.0, Pose2(), np.vstack((post, further)))
    assert memory.update(600.0, turned, np.empty((0, 2))) == pytest.approx(post)
    assert len(memory.update(600.1, Pose2(), ring(2.0))) == 0  # until rays pass


def test_a_reset_forgets_only_what_the_lidar_can_look_at_again() -> None:
    """After a reset the robot backs up: a post behind it that was forgotten was once almost backed into."""
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), HULL_M)
    ahead, behind = np.array(((0.4, 0.0),)), np.array(((-0.4, 0.0),))
    memory.update(0.0, Pose2(), np.vstack((ahead, behind)))
    memory.forget_beyond(Pose2(), 0.3)
    hiding = np.array(((0.2, 0.0),))
    assert memory.update(0.1, Pose2(), hiding) == pytest.approx(behind)


def test_what_was_last_seen_long_ago_may_be_off_by_more() -> None:
    """The pose drifts by driving and by turning; a pose that only trembles does not move on."""
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), HULL_M)
    post, nothing, turned = np.array(((0.4, 0.0),)), np.empty((0, 2)), Pose2(theta_rad=math.pi)
    memory.update(0.0, Pose2(), post)
    assert memory.spread_m.size == 0  # in view
    memory.update(0.1, turned, nothing)
    assert memory.spread_m == pytest.approx([SPREAD_PART * math.pi * HULL_M])
    for i in range(100):
        memory.update(0.2, Pose2(x_m=0.003 * (i % 2), theta_rad=math.pi), nothing)
    assert memory.spread_m == pytest.approx([SPREAD_PART * math.pi * HULL_M])
    for i in range(10):
        memory.update(0.3, Pose2(x_m=0.3 * (i % 2), theta_rad=math.pi), nothing)
    assert memory.spread_m == pytest.approx([MOST_SPREAD_M])
    memory.update(0.4, Pose2(), post)
    memory.update(0.5, turned, nothing)
    assert memory.spread_m == pytest.approx([SPREAD_PART * math.pi * HULL_M])  # seen again between


def test_a_goal_that_comes_and_goes_is_given_up() -> None:
    """Its cell is free in one cycle and taken in the next: nothing retries for ever."""
    navigator = Navigator(NavigationOptions(), Footprint())
    goal, pose, twist = Goal(x_m=1.5, y_m=0.0), Pose2(), Twist2()
    navigator.set_goal(goal)
    cells = np.zeros((100, 100), np.int8)
    grids = []
    for shut in (False, True):
        shown = cells.copy()
        if shut:
            shown[40:60, 70:72] = 100
            shown[40:42, 70:90] = shown[58:60, 70:90] = 100
            shown[40:60, 88:90] = 100
        grids.append(OccupancyGrid(cells=shown, resolution_m=0.05, origin_x_m=-2.5, origin_y_m=-2.5))
    for cycle in range(1200):
        time_s = 0.1 * cycle
        blocked = cycle // 25 % 2 == 1 and pose.x_m > 0.5
        output = navigator.update(time_s, pose, twist, grids[blocked], np.empty((0, 2)))
        twist = output.command
        pose = pose @ Pose2(x_m=0.1 * twist.v_m_s, theta_rad=0.1 * twist.w_rad_s)
        if pose.x_m > 0.75:  # held by the wall that it only sometimes sees
            pose = Pose2(x_m=0.75, y_m=pose.y_m, theta_rad=pose.theta_rad)
        if output.state is NavigationState.FAILED:
            break
    assert output.state is NavigationState.FAILED
    assert "gave up" in output.reason
    assert time_s < 90.0


def two_rooms(seen: int) -> OccupancyGrid:
    """Two rooms with a door; columns from `seen` on are unknown."""
    cells = np.zeros((80, 160), np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    cells[:, 80] = 100
    cells[30:50, 80] = 0
    cells[:, seen:] = -1
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)


def test_frontiers_are_where_free_ground_ends() -> None:
    start, options = Pose2(x_m=1.0, y_m=2.0), ExplorationOptions()
    found = find_frontiers(two_rooms(100), start, Footprint(), options)
    assert len(found) == 1
    assert found[0].x_m == pytest.approx(4.975, abs=0.051)
    assert found[0].way_m > 3.9
    assert find_frontiers(two_rooms(160), start, Footprint(), options) == []


def test_the_explorer_tries_each_frontier_once() -> None:
    explorer = Explorer(ExplorationOptions(), Footprint())
    start = Pose2(x_m=1.0, y_m=2.0)
    assert explorer.next_goal(two_rooms(100), start) is not None
    assert explorer.next_goal(two_rooms(100), start) is None


def test_a_frontier_in_a_nook_is_looked_at_from_where_the_robot_can_turn() -> None:
    """A nook 0.4 m wide, its end unknown: the centre may go in, but there is no room to turn."""
    cells = np.full((60, 80), 100, np.int8)
    cells[1:-1, 1:50] = 0
    cells[26:34, 50:56], cells[26:34, 56:79] = 0, -1
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    start, footprint = Pose2(x_m=1.0, y_m=1.0), Footprint()
    (nook,) = find_frontiers(grid, start, footprint, ExplorationOptions(least_frontier_m=0.1))
    assert nook.x_m > 2.7
    assert math.dist(nook.view_m, (nook.x_m, nook.y_m)) < 1.0
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
    ((row,), (col,)) = costmap.cells_of(np.array((nook.view_m,)))
    assert math.sqrt(costmap.squared_cells[row, col]) * 0.05 > HULL_M
    goal = Explorer(ExplorationOptions(least_frontier_m=0.1), footprint).next_goal(grid, start)
    assert goal is not None
    assert (goal.x_m, goal.y_m) == nook.view_m
    assert goal.theta_rad == pytest.approx(0.0, abs=0.3)  # and it faces the nook
    cells[:26, 1:50] = cells[34:, 1:50] = 100  # all of it a corridor as narrow: nowhere is room
    options = ExplorationOptions(least_frontier_m=0.1)
    (ahead,) = find_frontiers(grid, Pose2(x_m=1.0, y_m=1.5), footprint, options)
    assert ahead.view_m == (ahead.x_m, ahead.y_m)
