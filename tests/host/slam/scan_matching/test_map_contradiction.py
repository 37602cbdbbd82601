"""Scans of an area not mapped yet, and turns that odometry misreads."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2, wrap_angle
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.lidar.scan import Scan
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.grid_matcher import GridMatcher
from thumper.slam.grid.options import GridMapperOptions
from thumper_hil.world.world import World

NOTHING = np.zeros((0, 3))


def observe(world: World, pose: Pose2, half_deg: float, beams: int, range_max_m: float) -> Scan:
    angles_rad = np.radians(np.linspace(-half_deg, half_deg, beams))
    seen_m = world.cast(pose.x_m, pose.y_m, pose.theta_rad + angles_rad)
    return Scan(
        time_s=0.0,
        ranges_m=np.where(seen_m < range_max_m, seen_m, math.nan),
        angle_min_rad=float(angles_rad[0]),
        angle_increment_rad=float(angles_rad[1] - angles_rad[0]),
        range_max_m=range_max_m,
    )


def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, float]]:
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


def test_scan_of_a_new_area_is_inserted() -> None:
    room = World(segments_m=np.array(box(-3.0, -2.0, 4.0, 2.5)), circles_m=NOTHING)
    mapper, behind = GridMapper(), Pose2(theta_rad=math.pi)
    mapper.update(Pose2(), observe(room, Pose2(), 60.0, 121, 30.0), Twist2())
    update = mapper.update(behind, observe(room, behind, 60.0, 121, 30.0), Twist2())
    assert update.match_score < 0.3
    assert update.integrated
    for _ in range(12):
        update = mapper.update(behind, observe(room, behind, 60.0, 121, 30.0), Twist2())
    assert update.match_score > 0.9
    assert mapper.quality().lost == ""


@pytest.mark.parametrize(
    ("end_col", "share"),
    [
        (20.5, 1.0),  # in free space
        (39.5, 0.0),  # just before the wall
        (42.5, 0.0),  # just behind it
        (60.5, 1.0),  # through it
    ],
)
def test_hit_in_free_space_or_through_a_wall_contradicts_the_map(end_col: float, share: float) -> None:
    mapper = GridMapper()
    wall = World(segments_m=np.array([(2.0, -9.0, 2.0, 9.0)]), circles_m=NOTHING)
    mapper.update(Pose2(), observe(wall, Pose2(), 60.0, 241, 30.0), Twist2())
    matcher = GridMatcher(mapper.hit_grid, GridMapperOptions())

    def contradicting(col: float) -> float:
        end_m = 0.05 * np.array([[col, 0.5]])
        points = ScanPoints(
            origins_m=np.full((1, 2), 0.025), ends_m=end_m, kinds=np.array([HIT], dtype=np.uint8)
        )
        return matcher.evidence(points, Pose2()).contradicting_share

    assert contradicting(end_col) == share
    assert contradicting(-end_col) == 0.0


def test_misread_turn_is_corrected_with_long_beams() -> None:
    """At 60 m the heading's basin is half a degree; odometry is off by three.

    With one initial guess alone the final pose is off by 0.4 m and 2 degrees.
    """
    walls = box(0.0, 0.0, 110.0, 70.0) + box(30.0, 20.0, 50.0, 30.0) + box(70.0, 40.0, 85.0, 52.0)
    yard = World(segments_m=np.array(walls), circles_m=NOTHING)
    start = Pose2(x_m=54.0, y_m=12.0)
    mapper, truth, odometry = GridMapper(map_from_base=start), start, Pose2()
    for turn_rad in (0.0, *[0.11] * 14):
        truth = truth @ Pose2(theta_rad=turn_rad)
        odometry = odometry @ Pose2(theta_rad=1.5 * turn_rad)
        found = mapper.update(odometry, observe(yard, truth, 90.0, 181, 80.0), Twist2()).map_from_base
        assert found.distance_m(truth) < 0.12
        assert abs(wrap_angle(found.theta_rad - truth.theta_rad)) < math.radians(1.0)


def far_wall() -> World:
    """Return a wall of 2 m at the end of the lidar's range; nothing else returns."""
    return World(segments_m=np.array([(5.4, -1.6, 5.6, 0.4)]), circles_m=NOTHING)


def look(pose: Pose2, rng: np.random.Generator) -> Scan:
    scan = observe(far_wall(), pose, 120.0, 667, 5.6)
    return replace(scan, ranges_m=scan.ranges_m * (1.0 + 0.01 * rng.standard_normal(scan.ranges_m.size)))


def approach(seed: int, turn_std_rad: float) -> list[tuple[float, float]]:
    """Drive toward the wall with exact odometry; return how far the pose moves and turns from the truth."""
    mapper, rng, errors = GridMapper(), np.random.default_rng(seed), []
    for k in range(30):
        pose = Pose2(x_m=0.05 * k)
        found = mapper.update(pose, look(pose, rng), Twist2(), turn_std_rad=turn_std_rad).map_from_base
        errors.append((found.distance_m(pose), abs(found.theta_rad)))
    return errors


def test_another_part_of_a_wall_does_not_move_the_pose() -> None:
    """The first hits of what is not in the map yet must not be searched for in it."""
    wall = observe(
        World(segments_m=np.array([(5.0, -2.0, 5.0, 2.0)]), circles_m=NOTHING), Pose2(), 60, 481, 9
    )
    y_m = wall.ranges_m * np.sin(wall.angle_min_rad + wall.angle_increment_rad * np.arange(481))
    mapper = GridMapper()
    mapper.update(Pose2(), replace(wall, ranges_m=np.where(y_m > 1.0, wall.ranges_m, math.nan)), Twist2())
    other = replace(wall, ranges_m=np.where(abs(y_m - 0.3) < 0.4, wall.ranges_m, math.nan))
    assert mapper.update(Pose2(), other, Twist2()).map_from_base.distance_m(Pose2()) < 0.05


@pytest.mark.parametrize("seed", [8, 21, 23, 25])
def test_a_wall_at_the_end_of_the_range_does_not_turn_a_robot_with_a_gyroscope(seed: int) -> None:
    """Without one these scans turn it by 0.043 to 0.060 rad."""
    assert max(turned_rad for _, turned_rad in approach(seed, 0.0005)) < 0.02
