"""Slow zone, velocity smoother, obstacle memory, aborting and exploration."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.obstacle_memory import (
    ERROR_FRACTION,
    MAX_ERROR_M,
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
RADIUS_M = Footprint().circumscribed_radius_m


@pytest.mark.parametrize(("gap_m", "part"), [(0.10, 0.4), (0.24, 0.6), (0.36, 0.9), (0.6, 1.0)])
def test_slow_zone_scales_both_speeds_by_the_time_to_contact(gap_m: float, part: float) -> None:
    monitor = CollisionMonitor(CollisionMonitorOptions(), SpeedLimits(), Footprint())
    slow = monitor.slow_down(Twist2(v_m_s=0.4), np.array(((FRONT_M + gap_m, 0.0),)))
    assert slow.v_m_s == pytest.approx(part * 0.4, abs=0.06 * 0.4)
    bent = monitor.slow_down(Twist2(v_m_s=0.4, w_rad_s=0.2), np.array(((FRONT_M + gap_m, 0.0),)))
    assert bent.w_rad_s == pytest.approx(0.5 * bent.v_m_s)


def test_smoother_keeps_the_acceleration_limits() -> None:
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


def test_memory_keeps_hidden_points_and_clears_those_that_a_ray_passes() -> None:
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), RADIUS_M)
    post = np.array(((0.5, 0.0),))
    assert len(memory.update(0.0, Pose2(), post)) == 0  # in view: nothing to add
    assert memory.update(0.1, Pose2(theta_rad=math.pi), np.empty((0, 2))) == pytest.approx(post)  # behind
    assert memory.update(0.2, Pose2(), np.array(((0.3, 0.0),))) == pytest.approx(post)  # hidden by another
    assert len(memory.update(0.3, Pose2(), ring(2.0))) == 0  # rays pass it
    memory.update(1.0, Pose2(), post)
    assert len(memory.update(30.0, Pose2(theta_rad=math.pi), np.empty((0, 2)))) == 0  # too long ago
    memory.update(31.0, Pose2(), np.vstack((post, ((0.25, 0.2),))))
    memory.forget_beyond(Pose2(), 0.4)
    left = memory.update(31.1, Pose2(theta_rad=math.pi), np.empty((0, 2)))
    assert left == pytest.approx(np.array(((0.25, 0.2),)))


def test_points_beside_the_footprint_do_not_age() -> None:
    """A robot stationary for half a minute beside a post would otherwise forget it and swing into it."""
    memory, turned = (
        ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), RADIUS_M),
        Pose2(theta_rad=3.0),
    )
    post, further = np.array(((RADIUS_M + 0.05, 0.0),)), np.array(((RADIUS_M + 0.30, 0.1),))
    memory.update(0.0, Pose2(), np.vstack((post, further)))
    assert memory.update(600.0, turned, np.empty((0, 2))) == pytest.approx(post)
    assert len(memory.update(600.1, Pose2(), ring(2.0))) == 0  # until rays pass it


def test_reset_forgets_only_what_the_lidar_can_observe_again() -> None:
    """After a reset the robot backs up, so it must remember a post behind it."""
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), RADIUS_M)
    ahead, behind = np.array(((0.4, 0.0),)), np.array(((-0.4, 0.0),))
    memory.update(0.0, Pose2(), np.vstack((ahead, behind)))
    memory.forget_beyond(Pose2(), 0.3)
    hiding = np.array(((0.2, 0.0),))
    assert memory.update(0.1, Pose2(), hiding) == pytest.approx(behind)


def test_position_error_grows_with_the_distance_driven() -> None:
    """The pose drifts by driving and turning; pose noise at standstill adds nothing."""
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, FieldOfView(base_from_laser=Pose2()), RADIUS_M)
    post, nothing, turned = np.array(((0.4, 0.0),)), np.empty((0, 2)), Pose2(theta_rad=math.pi)
    memory.update(0.0, Pose2(), post)
    assert memory.position_error_m.size == 0  # in view
    memory.update(0.1, turned, nothing)
    assert memory.position_error_m == pytest.approx([ERROR_FRACTION * math.pi * RADIUS_M])
    for i in range(100):
        memory.update(0.2, Pose2(x_m=0.003 * (i % 2), theta_rad=math.pi), nothing)
    assert memory.position_error_m == pytest.approx([ERROR_FRACTION * math.pi * RADIUS_M])
    for i in range(10):
        memory.update(0.3, Pose2(x_m=0.3 * (i % 2), theta_rad=math.pi), nothing)
    assert memory.position_error_m == pytest.approx([MAX_ERROR_M])
    memory.update(0.4, Pose2(), post)
    memory.update(0.5, turned, nothing)
    assert memory.position_error_m == pytest.approx([ERROR_FRACTION * math.pi * RADIUS_M])  # seen between


def test_goal_that_comes_and_goes_is_aborted() -> None:
    """Its cell is free at times and blocked at others: nothing retries for ever."""
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
        if pose.x_m > 0.75:  # held by the wall that it sees only at times
            pose = Pose2(x_m=0.75, y_m=pose.y_m, theta_rad=pose.theta_rad)
        if output.state is NavigationState.FAILED:
            break
    assert output.state is NavigationState.FAILED
    assert "gave up" in output.reason
    assert time_s < 90.0


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
    assert explorer.next_goal(two_rooms(100), start) is not None
    assert explorer.next_goal(two_rooms(100), start) is None


def test_frontier_in_a_recess_is_observed_from_where_the_robot_can_turn() -> None:
    """A recess 0.4 m wide, its end unknown: the centre may enter, but there is no room to turn."""
    cells = np.full((60, 80), 100, np.int8)
    cells[1:-1, 1:50] = 0
    cells[26:34, 50:56], cells[26:34, 56:79] = 0, -1
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    start, footprint = Pose2(x_m=1.0, y_m=1.0), Footprint()
    (recess,) = find_frontiers(grid, start, footprint, ExplorationOptions(least_frontier_m=0.1))
    assert recess.x_m > 2.7
    assert math.dist(recess.viewpoint_m, (recess.x_m, recess.y_m)) < 1.0
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
    ((row,), (col,)) = costmap.cells_of(np.array((recess.viewpoint_m,)))
    assert math.sqrt(costmap.squared_cells[row, col]) * 0.05 > RADIUS_M
    goal = Explorer(ExplorationOptions(least_frontier_m=0.1), footprint).next_goal(grid, start)
    assert goal is not None
    assert (goal.x_m, goal.y_m) == recess.viewpoint_m
    assert goal.theta_rad == pytest.approx(0.0, abs=0.3)  # it faces the recess
    cells[:26, 1:50] = cells[34:, 1:50] = 100  # now all of it is as narrow: no room anywhere
    options = ExplorationOptions(least_frontier_m=0.1)
    (ahead,) = find_frontiers(grid, Pose2(x_m=1.0, y_m=1.5), footprint, options)
    assert ahead.viewpoint_m == (ahead.x_m, ahead.y_m)
