"""Manual driving that stops before what the lidar and the map show."""

from typing import Any, cast

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.local_model import NO_OBSTACLES, ObstaclePoints
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.speed_limits import SpeedLimits
from thumper.runtime.drive.assisted_teleop import AssistedCommand, AssistedTeleop
from thumper.runtime.sensor_inputs import BLIND_S
from thumper.runtime.state_estimator import RobotState

AHEAD = Twist2(v_m_s=0.3)
EMPTY_M = np.empty((0, 2))
TELEOP = AssistedTeleop(
    CollisionMonitor(CollisionMonitorOptions(), SpeedLimits(), Footprint()), FieldOfView()
)


def grid_with(*walls_m: tuple[float, float]) -> OccupancyGrid:
    """Return a free map of 8 m x 6 m, not at the origin, with single occupied cells."""
    grid = OccupancyGrid(
        cells=np.zeros((120, 160), np.int8), resolution_m=0.05, origin_x_m=-4.0, origin_y_m=-3.0
    )
    for wall_m in walls_m:
        grid.cells[grid.cell_of(*wall_m)] = 100
    return grid


class Slowest:
    """A monitor that stops what is faster ahead than `v_m_s`; it keeps the points that it was given."""

    def __init__(self, v_m_s: float) -> None:
        self.v_m_s = v_m_s
        self.points_m = EMPTY_M

    def slow_down(self, twist: Twist2, points_m: FloatArray) -> Twist2:
        self.points_m = points_m
        return twist

    def stop_reason(self, twist: Twist2, *_: object, **__: object) -> str | None:
        return "too fast" if twist.v_m_s > self.v_m_s else None


def limit(
    twist: Twist2,
    *walls_m: tuple[float, float],
    teleop: AssistedTeleop = TELEOP,
    hits_m: FloatArray = EMPTY_M,
    unseen_m: FloatArray = EMPTY_M,
    pose: Pose2 | None = None,
    scan_age_s: float = 0.1,
    lost: str = "",
) -> AssistedCommand:
    state = RobotState(
        time_s=1.0,
        map_from_base=pose or Pose2(),
        twist=Twist2(),
        hits_in_map_m=EMPTY_M,
        scan_age_s=scan_age_s,
        lost=lost,
    )
    error_m = np.zeros(len(hits_m) + len(unseen_m))
    obstacles = ObstaclePoints(np.concatenate((hits_m, unseen_m)), error_m, len(hits_m))
    return teleop.limit(twist, state, obstacles, lambda: grid_with(*walls_m))


def test_nothing_near_changes_nothing() -> None:
    assert limit(AHEAD, hits_m=np.array(((3.0, 0.0),))) == AssistedCommand(twist=AHEAD)


@pytest.mark.parametrize("pose", [Pose2(), Pose2(x_m=1.0, y_m=-0.5, theta_rad=2.0)])
def test_a_hit_before_the_robot_stops_it(pose: Pose2) -> None:
    """The obstacles are in the map's frame."""
    command = limit(AHEAD, hits_m=pose.apply(np.array(((0.22, 0.0),))), pose=pose)
    assert command.twist == Twist2()
    assert "0.22 m ahead" in command.reason


def test_a_robot_that_only_slows_down_says_so() -> None:
    command = limit(AHEAD, hits_m=np.array(((0.30, 0.0),)))
    assert 0.0 < command.twist.v_m_s < AHEAD.v_m_s
    assert command.reason == "slowed; an obstacle is near"
    assert limit(AHEAD, hits_m=np.array(((3.0, 2.0),))) == AssistedCommand(twist=AHEAD)


def test_a_hit_farther_ahead_slows_the_robot_and_says_so() -> None:
    """At full speed the way to a stop reaches the hit, at part of it not."""
    command = limit(Twist2(v_m_s=0.8), hits_m=np.array(((0.30, 0.0),)))
    assert 0.0 < command.twist.v_m_s < 0.8
    assert command.reason.startswith("slowed; stopped before an obstacle 0.30 m ahead")


def test_a_robot_that_may_not_go_on_may_turn() -> None:
    command = limit(Twist2(v_m_s=0.3, w_rad_s=0.3), hits_m=np.array(((0.226, 0.0),)))
    assert command.twist.v_m_s == 0.0
    assert command.twist.w_rad_s > 0.0
    assert command.reason.startswith("slowed; ")


def test_walls_of_the_map_count_where_the_lidar_does_not_look() -> None:
    behind = (-0.24, 0.0)
    backwards = Twist2(v_m_s=-0.3)
    assert limit(backwards, behind).twist == Twist2()
    pose = Pose2(x_m=1.0, y_m=-0.5)
    assert limit(backwards, (pose.x_m + behind[0], pose.y_m), pose=pose).twist == Twist2()
    assert limit(backwards, behind, lost="the robot was moved") == AssistedCommand(twist=backwards)
    assert limit(AHEAD, (0.24, 0.0)) == AssistedCommand(twist=AHEAD)  # the lidar sees that it has gone


def test_a_wall_that_only_the_map_shows_may_be_nearer_than_it_says() -> None:
    """At 0.06 m the robot stops for it, and not for a wall at 0.12 m; it creeps 1 cm and more."""
    creeping = Twist2(v_m_s=-0.04)
    assert limit(creeping, (-0.275, 0.0)).twist == Twist2()
    assert limit(creeping, (-0.325, 0.0)).twist == creeping


def test_ground_never_seen_stops_the_robot_and_the_reason_says_what_to_do() -> None:
    """It counts after the walls of the map, which are obstacles."""
    command = limit(Twist2(v_m_s=-0.3), (-3.0, 2.0), unseen_m=np.array(((-0.226, 0.0),)))
    assert command.twist == Twist2()
    assert command.reason.startswith("stopped before ground that the lidar has never seen 0.23 m behind")
    assert command.reason.endswith("look there first, or override the assistance")
    beside_tail_m = np.array(((-0.19, -0.18), (-0.19, 0.18)))
    arc = limit(Twist2(v_m_s=0.3, w_rad_s=1.0), unseen_m=beside_tail_m)
    assert arc.twist == Twist2(v_m_s=0.15), "straight ahead, until it has seen what its tail sweeps"
    blocked = limit(Twist2(v_m_s=0.3, w_rad_s=1.0), hits_m=beside_tail_m)
    assert blocked.twist == Twist2(), "who steers away must not be driven straight on"
    assert limit(AHEAD, unseen_m=np.array(((-0.24, 0.0),))).reason == ""
    assert "an obstacle" in limit(Twist2(v_m_s=-0.3), (-0.24, 0.0), unseen_m=np.array(((-0.9, 0.0),))).reason


def test_at_the_map_s_edge_the_rest_of_it_counts() -> None:
    """The window around the robot begins outside of the map."""
    pose = Pose2(x_m=-3.5, y_m=-2.5)
    assert limit(Twist2(v_m_s=-0.3), (-3.74, -2.5), pose=pose).twist == Twist2()


@pytest.mark.parametrize(
    ("scan_age_s", "reason"), [(BLIND_S, ""), (BLIND_S + 0.01, "not assisted: no recent scan")]
)
def test_without_scans_the_operator_decides_and_is_told(scan_age_s: float, reason: str) -> None:
    command = limit(AHEAD, scan_age_s=scan_age_s)
    assert command.twist == AHEAD
    assert command.reason == reason


def test_a_command_to_stand_is_never_commented() -> None:
    assert limit(Twist2(), scan_age_s=9.0) == AssistedCommand(twist=Twist2())


@pytest.mark.parametrize(
    ("v_m_s", "command"),
    [
        (0.4, AssistedCommand(twist=Twist2(v_m_s=0.4))),
        (0.3, AssistedCommand(twist=Twist2(v_m_s=0.2), reason="slowed; too fast")),
        (0.1, AssistedCommand(twist=Twist2(v_m_s=0.1), reason="slowed; too fast")),
        (0.0, AssistedCommand(twist=Twist2(), reason="too fast")),
    ],
)
def test_the_speed_is_halved_twice_at_most(v_m_s: float, command: AssistedCommand) -> None:
    monitor = Slowest(v_m_s)
    assert limit(Twist2(v_m_s=0.4), teleop=AssistedTeleop(cast("Any", monitor), FieldOfView())) == command


@pytest.mark.parametrize("x_m", [-9.0, -3.91, 0.01, 3.91, 9.0])
@pytest.mark.parametrize("y_m", [-9.0, -2.91, 0.01, 2.91, 9.0])
def test_the_walls_within_reach_count_and_no_others(x_m: float, y_m: float) -> None:
    """In the middle, at the map's edges and beyond them; cells of 65 % count as occupied."""
    grid = grid_with()
    grid.cells[:] = 65
    grid.cells[60:, 80:] = 64
    monitor, pose = Slowest(0.0), Pose2(x_m=x_m, y_m=y_m)
    teleop = AssistedTeleop(cast("Any", monitor), FieldOfView(range_m=0.0))
    state = RobotState(time_s=1.0, map_from_base=pose, twist=Twist2(), hits_in_map_m=EMPTY_M, scan_age_s=0.1)
    teleop.limit(AHEAD, state, NO_OBSTACLES, lambda: grid)
    expected_m = [
        (column_m - x_m, row_m - y_m)
        for row_m in -3.0 + 0.05 * (np.arange(120) + 0.5)
        for column_m in -4.0 + 0.05 * (np.arange(160) + 0.5)
        if max(abs(column_m - x_m), abs(row_m - y_m)) <= 1.2 + 0.025 and (column_m < 0.0 or row_m < 0.0)
    ]
    np.testing.assert_allclose(monitor.points_m, np.reshape(expected_m, (-1, 2)), atol=1e-9)
