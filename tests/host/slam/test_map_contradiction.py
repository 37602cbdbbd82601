"""Scans that the map does not hold yet, and turns that the wheels misread, with beams short and long."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.scan_matching.map_contradiction import contradicting_share
from thumper_hil.world.world import World

NOTHING = np.zeros((0, 3))


def look(world: World, pose: Pose2, half_deg: float, beams: int, range_max_m: float) -> Scan:
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


def test_what_lies_behind_the_robot_is_entered_although_the_map_explains_none_of_it() -> None:
    room = World(segments_m=np.array(box(-3.0, -2.0, 4.0, 2.5)), circles_m=NOTHING)
    mapper, behind = GridMapper(), Pose2(theta_rad=math.pi)
    mapper.update(Pose2(), look(room, Pose2(), 60.0, 121, 30.0), Twist2())
    update = mapper.update(behind, look(room, behind, 60.0, 121, 30.0), Twist2())
    assert update.match_score < 0.3
    assert update.integrated
    for _ in range(12):
        update = mapper.update(behind, look(room, behind, 60.0, 121, 30.0), Twist2())
    assert update.match_score > 0.9
    assert mapper.quality().lost == ""


@pytest.mark.parametrize(
    ("end_col", "share"),
    [
        (20.5, 1.0),  # where beams have passed
        (39.5, 0.0),  # just before the wall
        (42.5, 0.0),  # just behind it
        (60.5, 1.0),  # through it
    ],
)
def test_a_hit_in_free_space_or_behind_a_wall_speaks_against_the_map(end_col: float, share: float) -> None:
    mapper = GridMapper()
    wall = World(segments_m=np.array([(2.0, -9.0, 2.0, 9.0)]), circles_m=NOTHING)
    mapper.update(Pose2(), look(wall, Pose2(), 60.0, 241, 30.0), Twist2())
    cells = mapper.cells
    corner = np.array(cells.corner_m) / cells.resolution_m
    origins, ends = np.array([[0.5, 0.5]]) - corner, np.array([[end_col, 0.5]]) - corner
    assert contradicting_share(origins, ends, cells.misses, cells.distance_m, cells.resolution_m) == share
    beside = np.array([[-end_col, 0.5]]) - corner  # nobody has looked there
    assert contradicting_share(origins, beside, cells.misses, cells.distance_m, cells.resolution_m) == 0.0


def test_a_turn_read_half_too_large_is_set_right_with_long_beams() -> None:
    """At 60 m the heading's basin is half a degree; the wheels are three off.

    With one start alone the pose ends 0.4 m and 2 degrees off.
    """
    walls = box(0.0, 0.0, 110.0, 70.0) + box(30.0, 20.0, 50.0, 30.0) + box(70.0, 40.0, 85.0, 52.0)
    yard = World(segments_m=np.array(walls), circles_m=NOTHING)
    start = Pose2(x_m=54.0, y_m=12.0)
    mapper, truth, odometry = GridMapper(map_from_base=start), start, Pose2()
    for turn_rad in (0.0, *[0.11] * 14):
        truth = truth @ Pose2(theta_rad=turn_rad)
        odometry = odometry @ Pose2(theta_rad=1.5 * turn_rad)
        found = mapper.update(odometry, look(yard, truth, 90.0, 181, 80.0), Twist2()).map_from_base
        assert found.distance_m(truth) < 0.12
        assert abs(wrap_angle(found.theta_rad - truth.theta_rad)) < math.radians(1.0)
