"""Glass: a straight piece that moves along its own line as the robot moves, and goes on beyond its ends."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.glass import BEYOND_M, Glass
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.speed_limits import SpeedLimits

VIEW, FOOTPRINT = FieldOfView(), Footprint.rectangle(length_m=0.42, width_m=0.30)
BEAMS_RAD = np.radians(np.arange(-120.0, 120.0, 0.36))
ROOM = ((-2.0, -1.5, 3.0, -1.5), (3.0, -1.5, 3.0, 1.5), (3.0, 1.5, -2.0, 1.5))
PANE = (-0.5, -0.42, 1.0, -0.1)  # converges with the way along the x axis
Walls = tuple[tuple[float, ...], ...]


def scan(pose: Pose2, matt: Walls, glass: Walls, visible_deg: float = 10.0) -> FloatArray:
    """Return the hits in map, shape (n, 2), of walls x0 y0 x1 y1; ranges have a noise of 3 mm."""
    lidar = pose @ VIEW.base_from_laser
    rays = np.column_stack([f(lidar.theta_rad + BEAMS_RAD) for f in (np.cos, np.sin)])
    ranges_m = np.full(len(rays), np.inf)
    for wall, is_glass in [*((wall, False) for wall in matt), *((wall, True) for wall in glass)]:
        start_m, side_m = np.array(wall[:2]), np.array(wall[2:]) - wall[:2]
        normal = np.array((-side_m[1], side_m[0])) / math.hypot(*side_m)
        slant = rays @ normal
        to_start_m = start_m - (lidar.x_m, lidar.y_m)
        range_m = (to_start_m @ normal) / np.where(np.abs(slant) < 1e-9, 1e-9, slant)
        along = (range_m[:, None] * rays - to_start_m) @ side_m / (side_m @ side_m)
        is_hit = (range_m > 0.02) & (along >= 0.0) & (along <= 1.0)
        if is_glass:
            is_hit &= np.abs(slant) > math.cos(math.radians(visible_deg))
        ranges_m = np.where(is_hit & (range_m < ranges_m), range_m, ranges_m)
    ranges_m += np.random.default_rng(1).normal(0.0, 0.003, len(ranges_m))
    hit = np.isfinite(ranges_m)
    hits_m: FloatArray = np.array((lidar.x_m, lidar.y_m)) + ranges_m[hit, None] * rays[hit]
    return hits_m


def drive(
    glass: Glass,
    matt: Walls,
    panes: Walls = (),
    *,
    from_m: float = -0.4,
    to_m: float = 0.1,
    visible_deg: float = 10.0,
    jump: Pose2 | None = None,
    order: int = 1,
) -> Pose2:
    """Drive along the x axis at 0.2 m/s and show each scan; return the last pose.

    `jump` moves the map. The `order` of the beams is -1 if the lidar turns clockwise.
    """
    jump = jump or Pose2()
    for step, x_m in enumerate(np.arange(from_m, to_m, 0.02)):
        pose = Pose2(x_m=float(x_m))
        glass.update(0.1 * step, jump @ pose, jump.apply(scan(pose, matt, panes, visible_deg)[::order]))
    return pose


@pytest.fixture
def glass() -> Glass:
    return Glass(VIEW, FOOTPRINT, 3.0)


def test_a_pane_goes_on_ahead_of_what_was_seen_of_it(glass: Glass) -> None:
    pose = drive(glass, ROOM, (PANE,))
    seen_m = scan(pose, (), (PANE,))
    assert glass.points_m[:, 0].max() == pytest.approx(seen_m[:, 0].max() + BEYOND_M, abs=0.04)
    slope = (PANE[3] - PANE[1]) / (PANE[2] - PANE[0])
    off_m = glass.points_m[:, 1] - PANE[1] - slope * (glass.points_m[:, 0] - PANE[0])
    assert np.abs(off_m).max() < 0.03


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_nearer_beyond_silent_beams_does_not_hide_a_pane(glass: Glass, order: int) -> None:
    drive(glass, ((0.3, -0.3, 0.3, -0.1),), ((-0.5, -0.6, 1.0, -0.6),), order=order)
    assert len(glass.points_m)


def test_the_robot_does_not_drive_on_into_a_pane_of_which_it_sees_a_piece_beside_it(glass: Glass) -> None:
    pose = drive(glass, ROOM, (PANE,), to_m=0.35)
    limits = SpeedLimits()
    monitor = CollisionMonitor(CollisionMonitorOptions(), limits, FOOTPRINT)

    def stops(points_m: FloatArray) -> bool:
        command, in_base_m = Twist2(v_m_s=0.2), pose.inverse().apply(points_m)
        return monitor.stop_reason(command, command, in_base_m, np.zeros(len(in_base_m)), 0.1) is not None

    hits_m = scan(pose, ROOM, (PANE,))
    assert not stops(hits_m)
    assert stops(np.vstack((hits_m, glass.points_m)))


def test_no_glass_where_the_ends_of_a_piece_stay_or_something_hides_them(glass: Glass) -> None:
    box = ((0.1, -0.4, 0.3, -0.4), (0.3, -0.4, 0.3, -0.6), (0.1, -0.6, 0.1, -0.4))
    drive(glass, (*ROOM, *box), to_m=0.6)
    assert not len(glass.points_m)
    drive(glass, ((-2.0, -0.3, 0.5, -0.3), *ROOM), to_m=0.6)
    assert not len(glass.points_m)
    behind_a_door = ((-2.0, -0.6, 2.0, -0.6), (-2.0, -0.3, 0.0, -0.3), (0.2, -0.3, 2.0, -0.3))
    drive(glass, (*behind_a_door, *ROOM), to_m=0.6)
    assert not len(glass.points_m)


def test_polished_metal_is_like_glass_and_what_is_seen_obliquely_is_not(glass: Glass) -> None:
    drive(glass, ROOM, (PANE,), visible_deg=35.0)
    assert not len(glass.points_m)
    drive(glass, ROOM, (PANE,), visible_deg=25.0)
    assert len(glass.points_m)


def test_a_pane_ends_where_a_beam_passes_squarely(glass: Glass) -> None:
    pane, jump = (-0.5, -0.3, 0.3, -0.3), Pose2(x_m=0.2, theta_rad=math.pi / 2)
    drive(glass, ROOM, (pane,), to_m=0.1)
    assert glass.points_m[:, 0].max() > 0.4
    glass.move(jump)
    drive(glass, ROOM, (pane,), from_m=0.24, to_m=0.5, jump=jump)
    assert 0.25 < jump.inverse().apply(glass.points_m)[:, 0].max() < 0.38


def test_a_leg_that_walks_past_is_no_glass(glass: Glass) -> None:
    for step in range(20):
        angles_rad = np.radians(np.arange(0.0, 361.0, 15.0))
        leg_m = np.column_stack([0.06 * f(angles_rad) for f in (np.cos, np.sin)])
        leg_m += (-0.2 + 0.03 * step, -0.4)
        leg = tuple(tuple(map(float, side)) for side in np.hstack((leg_m[:-1], leg_m[1:])))
        glass.update(0.1 * step, Pose2(), scan(Pose2(), (*ROOM, *leg), ()))
    assert not len(glass.points_m)


def test_a_pane_that_was_forgotten_comes_back_while_a_piece_is_seen(glass: Glass) -> None:
    pose = drive(glass, ROOM, (PANE,))
    for step in range(50):
        glass.update(3.0 + 0.1 * step, pose, scan(pose, ROOM, (PANE,)))
    glass.forget_beyond(pose, 0.0)
    assert not len(glass.points_m)
    glass.update(8.0, pose, scan(pose, ROOM, (PANE,)))
    assert len(glass.points_m)


def test_no_glass_where_the_robot_is(glass: Glass) -> None:
    drive(glass, ROOM, (PANE,))
    on_it = Pose2(y_m=-0.3)
    glass.update(3.0, on_it, scan(on_it, ROOM, ()))
    across_m, along_m = on_it.inverse().apply(glass.points_m).T
    assert not ((np.abs(across_m) < 0.16) & (np.abs(along_m) < 0.10)).any()


def test_panes_stay_when_the_map_moves_and_go_when_they_are_far(glass: Glass) -> None:
    pose = drive(glass, ROOM, (PANE,))
    before_m, jump = glass.points_m, Pose2(x_m=0.3, theta_rad=0.2)
    glass.move(jump)
    np.testing.assert_allclose(glass.points_m, jump.apply(before_m))
    glass.forget_beyond(jump @ pose, 0.3)
    assert 0 < len(glass.points_m) < len(before_m)
