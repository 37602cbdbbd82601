"""A bare corridor: odometry alone decides along it, and the mapper reports the growing uncertainty."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.mapper import Mapper
from thumper.slam.particle_filter.rbpf_mapper import RbpfMapper
from thumper.slam.scan_matching.degeneracy import weakest_direction
from thumper.slam.scan_matching.gauss_newton import (
    DEGENERATE_STD_M,
    MIN_WALL_SHARE,
    MatchOptions,
    odometry_information,
)
from thumper.slam.scan_matching.pose_covariance import PoseCovarianceOptions
from thumper_hil.world.world import World

WALLS = np.array([[-60.0, -1.2, 60.0, -1.2], [-60.0, 1.2, 60.0, 1.2]])
ANGLES_RAD = np.radians(np.linspace(-120.0, 120.0, 241))


def corridor(turn_rad: float, ends_at_m: float = 60.0) -> World:
    """Return a rotated corridor, 2.4 m wide and 120 m long, with a wall across it at `ends_at_m`."""
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    walls = np.vstack((WALLS, [[ends_at_m, -1.2, ends_at_m, 1.2]])).reshape(-1, 2) @ [[cos, sin], [-sin, cos]]
    return World(segments_m=walls.reshape(-1, 4), circles_m=np.zeros((0, 3)))


def observe(world: World, pose: Pose2, rng: np.random.Generator) -> Scan:
    ranges_m = world.cast(pose.x_m, pose.y_m, pose.theta_rad + ANGLES_RAD)
    ranges_m = ranges_m + 0.01 * rng.standard_normal(ranges_m.size)
    return Scan(
        time_s=0.0,
        ranges_m=np.where(ranges_m < 4.0, ranges_m, np.nan),
        angle_min_rad=float(ANGLES_RAD[0]),
        angle_increment_rad=float(ANGLES_RAD[1] - ANGLES_RAD[0]),
        range_max_m=4.0,
    )


def drive(mapper: Mapper, world: World, turn_rad: float, steps: int = 150, long: float = 1.04) -> Pose2:
    """Drive 5 cm per scan along the corridor; odometry reads 4 % too long. Return the true final pose."""
    rng, pose, odometry = np.random.default_rng(5), Pose2(theta_rad=turn_rad), Pose2()
    for _ in range(steps):
        mapper.update(odometry, observe(world, pose, rng), Twist2())
        pose, odometry = pose @ Pose2(x_m=0.05), odometry @ Pose2(x_m=0.05 * long)
    mapper.update(odometry, observe(world, pose, rng), Twist2())
    return pose


@pytest.mark.parametrize("turn_rad", [0.0, 0.3, math.pi / 4])
@pytest.mark.parametrize("kind", [GridMapper, RbpfMapper])
def test_end_of_the_map_does_not_hold_back_the_pose(
    kind: type[GridMapper] | type[RbpfMapper], turn_rad: float
) -> None:
    """A match along the corridor would stick to the end of the map: half of the distance would be lost."""
    mapper = kind(map_from_base=Pose2(theta_rad=turn_rad))
    truth = drive(mapper, corridor(turn_rad), turn_rad)
    odometry = Pose2(x_m=150 * 0.05 * 1.04)
    found = mapper.map_from_odom @ odometry
    assert found.distance_m(truth) < 1.1 * 0.04 * 7.5
    assert mapper.quality().std_m > 0.1


def test_pose_is_lost_in_a_long_corridor_until_its_end_is_visible() -> None:
    options = GridMapperOptions(confidence=PoseCovarianceOptions(lost_beyond_m=0.2))
    mapper = GridMapper(options)
    drive(mapper, corridor(0.0, ends_at_m=12.5), 0.0, steps=150)
    assert "no visible wall fixes the position" in mapper.quality().lost
    mapper = GridMapper(options)
    drive(mapper, corridor(0.0, ends_at_m=12.5), 0.0, steps=200)  # the wall became visible
    assert mapper.quality().lost == ""


def test_pose_is_lost_if_scans_do_not_fit() -> None:
    mapper = GridMapper()
    rng = np.random.default_rng(1)
    drive(mapper, corridor(0.0, ends_at_m=4.0), 0.0, steps=10)
    before = mapper.grid().cells
    posts = rng.uniform(-3.5, 3.5, (60, 2))
    crowd = World(segments_m=np.zeros((0, 4)), circles_m=np.column_stack((posts, np.full(60, 0.1))))
    for _ in range(12):
        mapper.update(Pose2(x_m=0.5), observe(crowd, Pose2(), rng), Twist2())
    assert "the map explains only" in mapper.quality().lost
    np.testing.assert_array_equal(mapper.grid().cells, before)  # nor is the scan inserted


@pytest.mark.parametrize("turn_rad", [0.0, 0.7, 2.0])
def test_weakest_direction_is_the_corridors(turn_rad: float) -> None:
    angles_rad = np.linspace(-2.0, 2.0, 300)
    ranges_m = corridor(0.0).cast(0.0, 0.3, angles_rad + turn_rad)
    near = ranges_m < 6.0
    points_m = (ranges_m * np.array([np.cos(angles_rad), np.sin(angles_rad)]))[:, near].T
    x, y, share = weakest_direction(np.ascontiguousarray(points_m))
    assert share < 0.001
    assert abs(math.sin(math.atan2(y, x) + turn_rad)) < 0.01


def test_corner_constrains_all_directions() -> None:
    side = np.linspace(0.0, 2.0, 50)
    points_m = np.concatenate(
        (np.column_stack((side, 0 * side + 2.0)), np.column_stack((0 * side + 2.0, side[::-1])))
    )
    assert weakest_direction(points_m)[2] > 0.4
    assert weakest_direction(np.zeros((0, 2)))[2] == 0.0


def test_distant_wall_counts_although_its_beams_end_a_metre_apart() -> None:
    angles_rad = np.radians(np.linspace(-90.0, 90.0, 181))
    rng = np.random.default_rng(1)

    def seen(ends_at_m: float) -> tuple[float, float, float]:
        walls = [
            [-10.0, -12.0, 200.0, -12.0],
            [-10.0, 12.0, 200.0, 12.0],
            [ends_at_m, -12.0, ends_at_m, 12.0],
        ]
        ranges_m = World(segments_m=np.array(walls), circles_m=np.zeros((0, 3))).cast(0.0, 0.0, angles_rad)
        ranges_m += 0.03 * rng.standard_normal(ranges_m.size)
        points_m = (ranges_m * np.array([np.cos(angles_rad), np.sin(angles_rad)]))[:, ranges_m < 80.0].T
        return weakest_direction(np.ascontiguousarray(points_m))

    assert seen(60.0)[2] > 2.0 * MIN_WALL_SHARE
    x, _, share = seen(190.0)  # not visible: the far ends of the fences are no wall across
    assert share < MIN_WALL_SHARE
    assert abs(x) > 0.99


def test_uncertain_pose_loosens_the_prediction() -> None:
    """The first walls across a corridor may correct what it left undetermined; the rest stays tight."""
    options, moved = MatchOptions(), Pose2(x_m=0.1)
    sure = odometry_information(options, moved, np.zeros(2))
    unsure = odometry_information(options, moved, np.zeros(2), np.diag([0.3**2, 0.0, 0.0]))
    assert sure[0, 0] == pytest.approx(0.03**-2)
    assert unsure[0, 0] == pytest.approx(1.0 / (0.03**2 + 0.3**2))
    np.testing.assert_allclose(np.diag(unsure)[1:], np.diag(sure)[1:])
    still_degenerate = odometry_information(options, moved, np.array([1.0, 0.0]), np.diag([0.3**2, 0.0, 0.0]))
    assert still_degenerate[0, 0] > 0.9 * DEGENERATE_STD_M**-2
