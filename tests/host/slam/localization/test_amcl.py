"""Localisation in a known map: found anywhere, followed, lost, found again."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.host.slam.rooms import ROOM, rectangle, room_scan
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.localization.amcl import Amcl
from thumper.slam.mode_switch import SlamModeSwitch
from thumper_hil.world.world import World

STILL = Twist2()
GRID = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()


def drive(
    localiser: Amcl | SlamModeSwitch,
    path: list[Pose2],
    odometry: Pose2,
    slip: float = 0.1,
    walls: FloatArray = ROOM,
) -> Pose2:
    """Drive from pose to pose with odometry that turns and goes too far; returns the odometry at the end."""
    rng = np.random.default_rng(3)
    for before, pose in itertools.pairwise(path):
        step = before.inverse() @ pose
        odometry = odometry @ Pose2(
            x_m=(1 + slip) * step.x_m, y_m=step.y_m, theta_rad=(1 + slip) * step.theta_rad
        )
        localiser.update(odometry, room_scan(pose, noise_m=0.01, rng=rng, walls=walls), STILL)
    return odometry


def way(start: Pose2, steps: int = 15) -> list[Pose2]:
    """An arc of 0.1 m and 0.12 rad a step."""
    path = [start]
    for _ in range(steps):
        path.append(path[-1] @ Pose2(x_m=0.08, theta_rad=0.15))
    return path


def error_m(localiser: Amcl, truth: Pose2) -> float:
    assert abs(wrap_angle(localiser.map_from_base.theta_rad - truth.theta_rad)) < 0.05
    return localiser.map_from_base.distance_m(truth)


@pytest.mark.parametrize(("x_m", "y_m", "theta_rad"), [(0.3, 0.4, 2.0), (-1.5, 2.0, -1.0), (2.2, -0.8, 3.0)])
def test_the_pose_is_found_anywhere(x_m: float, y_m: float, theta_rad: float) -> None:
    start = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    localiser = Amcl(GRID)
    assert localiser.quality().lost
    localiser.update(Pose2(), room_scan(start), STILL)
    assert error_m(localiser, start) < 0.05
    path = way(start, 8)
    drive(localiser, path, Pose2())  # from one spot the room turned half round looks nearly the same
    assert error_m(localiser, path[-1]) < 0.05
    assert localiser.relocalizations == 1
    assert localiser.quality().lost == ""


def test_a_pose_by_hand_is_refined_and_followed_with_fewer_particles() -> None:
    start = Pose2(x_m=0.2, y_m=0.3)
    localiser = Amcl(GRID, map_from_base=Pose2(x_m=0.4, y_m=0.1, theta_rad=0.15))
    before, before_particles = localiser.quality(), localiser.particles
    path = way(start)
    localiser.update(Pose2(), room_scan(start), STILL)
    drive(localiser, path, Pose2())
    after = localiser.quality()
    assert error_m(localiser, path[-1]) < 0.05
    assert localiser.particles < 0.3 * before_particles
    assert after.std_m < 0.1 < before.std_m
    assert after.explained > 0.7
    assert localiser.relocalizations == 0


PLAIN = np.concatenate((rectangle(-4.0, -2.5, 4.0, 2.5), rectangle(3.0, 1.9, 4.0, 2.5)))  # but for a cupboard
PLAIN_GRID = World(segments_m=PLAIN, circles_m=np.zeros((0, 3))).to_grid()
STARTS = [Pose2(x_m=1.0, y_m=0.5, theta_rad=0.3), Pose2(x_m=-1.2, y_m=-0.8, theta_rad=2.5)]


@pytest.mark.parametrize("true", STARTS)
def test_a_start_half_a_turn_round_in_a_plain_room_is_not_believed(true: Pose2) -> None:
    localiser = Amcl(
        PLAIN_GRID, map_from_base=Pose2(x_m=-true.x_m, y_m=-true.y_m, theta_rad=true.theta_rad + 3)
    )
    localiser.update(Pose2(), room_scan(true, walls=PLAIN), STILL)
    assert localiser.quality().lost or error_m(localiser, true) < 0.05  # no drive begins
    path = way(true, 8)
    drive(localiser, path, Pose2(), walls=PLAIN)
    assert error_m(localiser, path[-1]) < 0.05
    assert localiser.quality().lost == ""


def test_a_wrong_start_that_nothing_in_sight_tells_apart_is_found_out_on_the_way() -> None:
    """The cupboard in the corner comes into sight of a lidar of 3 m after some steps."""
    true = Pose2(x_m=-2.0, y_m=0.3, theta_rad=0.1)
    path = [true @ Pose2(x_m=0.15 * k) for k in range(28)]
    scans = [room_scan(pose, walls=PLAIN) for pose in path]
    near = [replace(scan, ranges_m=np.where(scan.ranges_m > 3.0, np.nan, scan.ranges_m)) for scan in scans]
    localiser = Amcl(PLAIN_GRID, map_from_base=Pose2(x_m=2.0, y_m=-0.3, theta_rad=0.1 + math.pi))
    believed = []
    for k, scan in enumerate(near):
        localiser.update(Pose2(x_m=0.15 * k), scan, STILL)
        believed.append(localiser.map_from_base.distance_m(path[k]) < 0.2)
        assert localiser.quality().lost == ""
    assert not believed[0]
    assert believed[-1]
    assert error_m(localiser, path[-1]) < 0.05


def test_who_names_the_same_place_again_is_believed() -> None:
    true, named = STARTS[0], Pose2(x_m=-1.0, y_m=-0.5, theta_rad=0.3 - math.pi)
    localiser = Amcl(PLAIN_GRID, map_from_base=named)
    localiser.update(Pose2(), room_scan(true, walls=PLAIN), STILL)
    localiser.set_pose(named @ Pose2(x_m=0.1))
    localiser.update(Pose2(), room_scan(true, walls=PLAIN), STILL)
    assert localiser.map_from_base.distance_m(named) < 0.1


@pytest.mark.parametrize("moved", [[], [(0.2, 1.2, 0.8, 1.7)]])  # what stands there since the map was made
@pytest.mark.parametrize("off", [(0.1, 3.0), (0.5, 20.0)])
@pytest.mark.parametrize("true", STARTS)
def test_a_rough_start_that_is_right_is_believed_at_once(
    true: Pose2, off: tuple[float, float], moved: list[tuple[float, float, float, float]]
) -> None:
    walls = np.concatenate((PLAIN, *(rectangle(*box) for box in moved)))
    for way_rad, sign in itertools.product((0.0, 2.0, 4.0), (-1.0, 1.0)):
        slip = Pose2(x_m=off[0] * math.cos(way_rad), y_m=off[0] * math.sin(way_rad))
        named = true @ slip @ Pose2(theta_rad=sign * math.radians(off[1]))
        localiser = Amcl(PLAIN_GRID, map_from_base=named, std_m=0.1, std_rad=0.05)
        localiser.update(Pose2(), room_scan(true, walls=walls), STILL)
        assert localiser.quality().lost == ""
        assert error_m(localiser, true) < 0.05


def test_a_wrong_map_is_doubted_and_the_right_one_is_not() -> None:
    path = way(Pose2(x_m=0.2, y_m=0.3), 30)
    for grid, doubt in ((GRID, ""), (PLAIN_GRID, "the map explains only")):
        localiser = Amcl(grid)
        localiser.update(Pose2(), room_scan(path[0]), STILL)
        assert localiser.map_doubt == ""  # from one scan nobody can tell
        drive(localiser, path, Pose2())
        assert localiser.map_doubt.startswith(doubt)
        assert bool(localiser.map_doubt) == bool(doubt)


def test_a_kidnapped_robot_says_so_and_is_found_again() -> None:
    start = Pose2(x_m=0.2, y_m=0.3)
    localiser = Amcl(GRID, map_from_base=start)
    localiser.update(Pose2(), room_scan(start), STILL)
    odometry = drive(localiser, way(start, 5), Pose2())
    elsewhere = way(Pose2(x_m=2.3, y_m=-0.9, theta_rad=2.5))
    lost = ""
    for here, there in itertools.pairwise(elsewhere):
        odometry = drive(localiser, [here, there], odometry)
        lost = lost or localiser.quality().lost
    assert lost
    assert localiser.relocalizations >= 1
    assert error_m(localiser, elsewhere[-1]) < 0.06


def test_a_robot_that_was_placed_wrongly_is_found_though_it_stands() -> None:
    """Nobody drives a lost robot: it must not need to be driven to be found."""
    true = Pose2(x_m=0.3, y_m=0.4, theta_rad=2.0)
    localiser = Amcl(GRID, map_from_base=Pose2(x_m=-1.0, y_m=1.5))
    for _ in range(30):
        localiser.update(Pose2(), room_scan(true), STILL)
    assert error_m(localiser, true) < 0.05
    assert localiser.quality().explained > 0.7


def test_a_robot_that_stands_still_keeps_pose_and_particles() -> None:
    start = Pose2(x_m=0.2, y_m=0.3)
    localiser = Amcl(GRID, map_from_base=start)
    rng = np.random.default_rng(4)
    localiser.update(Pose2(), room_scan(start, noise_m=0.02, rng=rng), STILL)
    pose, quality = localiser.map_from_base, localiser.quality()
    for _ in range(30):
        localiser.update(Pose2(), room_scan(start, noise_m=0.02, rng=rng), STILL)
    assert localiser.map_from_base == pose
    np.testing.assert_array_equal(localiser.quality().covariance, quality.covariance)


def test_the_map_does_not_change() -> None:
    before = GRID.cells.copy()
    localiser = Amcl(GRID, map_from_base=Pose2())
    drive(localiser, way(Pose2()), Pose2())
    np.testing.assert_array_equal(localiser.grid().cells, before)


def test_a_blind_scan_moves_by_odometry() -> None:
    localiser = Amcl(GRID, map_from_base=Pose2(x_m=1.0))
    blind = Scan(time_s=0.0, ranges_m=np.full(90, np.nan), angle_min_rad=0.0, angle_increment_rad=0.07)
    localiser.update(Pose2(), room_scan(Pose2(x_m=1.0)), STILL)
    pose = localiser.map_from_base
    update = localiser.update(Pose2(x_m=0.3), blind, STILL)
    assert math.isnan(update.match_score)
    assert update.map_from_base.distance_m(pose @ Pose2(x_m=0.3)) < 1e-9


def test_mapping_localising_and_mapping_again_without_a_jump() -> None:
    path = way(Pose2(), 30)
    robot = SlamModeSwitch(GridMapper())
    robot.update(Pose2(), room_scan(path[0]), STILL)
    odometry = drive(robot, path[:11], Pose2())
    robot.localize()
    frozen = robot.grid()
    odometry = drive(robot, path[10:21], odometry)
    assert _same(robot.grid(), frozen.cells)
    robot.resume_mapping()
    odometry = drive(robot, path[20:], odometry)
    assert not _same(robot.grid(), frozen.cells)
    assert (robot.map_from_odom @ odometry).distance_m(path[-1]) < 0.05


def test_mapping_does_not_go_on_from_a_lost_pose() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.update(Pose2(), room_scan(Pose2()), STILL)
    robot.localize()
    assert robot.localizer is not None
    robot.localizer.relocalize()
    with pytest.raises(ThumperError, match="spoil the map"):
        robot.resume_mapping()


def _same(grid: OccupancyGrid, cells: FloatArray | np.ndarray[tuple[int, int], np.dtype[np.int8]]) -> bool:
    return grid.cells.shape == cells.shape and bool((grid.cells == cells).all())


def test_a_map_from_disk_is_localised_in_and_mapped_on() -> None:
    path = way(Pose2(), 20)
    robot = SlamModeSwitch(GridMapper())
    robot.update(Pose2(x_m=5.0), room_scan(path[0]), STILL)
    robot.localize_in(GRID, Pose2(x_m=0.05, y_m=-0.05))
    assert (robot.map_from_odom @ Pose2(x_m=5.0)).distance_m(Pose2()) < 0.1  # at once, without a scan
    odometry = drive(robot, path[:11], Pose2(x_m=5.0))
    assert robot.grid() is GRID
    robot.set_pose(path[10])
    odometry = drive(robot, path[10:13], odometry)
    robot.resume_mapping()
    odometry = drive(robot, path[12:], odometry)
    assert robot.grid() is not GRID
    assert (robot.map_from_odom @ odometry).distance_m(path[-1]) < 0.05
    walls = np.argwhere(robot.grid().cells == OCCUPIED)
    known = np.argwhere(GRID.cells == OCCUPIED)
    assert 0.9 * len(known) < len(walls) < 1.3 * len(known)


@pytest.mark.parametrize("told", [Pose2(x_m=0.05, y_m=-0.05), None])
def test_mapping_goes_on_in_the_counts_of_another_day(told: Pose2 | None) -> None:
    """A box that stood there has been taken away meanwhile; the robot is switched on elsewhere."""
    box = np.concatenate((ROOM, rectangle(0.6, -0.3, 0.9, 0.0)))
    begun = Pose2(y_m=0.8, theta_rad=1.0)
    before = GridMapper(map_from_base=begun)
    for pose in way(begun, 30):
        before.update(pose, room_scan(pose, walls=box), STILL)
    counts = before.counts()
    robot, path = SlamModeSwitch(GridMapper()), way(Pose2(), 60)
    robot.resume_from(counts, told)
    assert robot.counts() is counts
    assert counts.hits.max() > 20
    robot.update(Pose2(x_m=5.0), room_scan(path[0]), STILL)
    odometry = drive(robot, path, Pose2(x_m=5.0))
    assert robot.localizer is None
    assert (robot.map_from_odom @ odometry).distance_m(path[-1]) < 0.05
    old, new = before.grid(), robot.grid()
    inside = [(x, y) for x in np.arange(0.55, 1.0, 0.05) for y in np.arange(-0.35, 0.1, 0.05)]
    assert sum(old.cells[old.cell_of(x, y)] == OCCUPIED for x, y in inside) > 10
    assert sum(new.cells[new.cell_of(x, y)] == OCCUPIED for x, y in inside) == 0
    assert robot.counts().hits.sum() > counts.hits.sum()


def test_mapping_does_not_go_on_before_the_place_is_known() -> None:
    square = np.concatenate((rectangle(-2.0, -2.0, 2.0, 2.0), rectangle(4.0, -2.0, 8.0, 2.0)))
    grid = World(segments_m=square, circles_m=np.zeros((0, 3))).to_grid()
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(grid), None)
    scan = room_scan(Pose2(x_m=0.4, y_m=0.3), walls=square)
    for _ in range(3):
        assert not robot.update(Pose2(), scan, STILL).integrated
    assert "several places" in robot.quality().lost
    assert robot.mode == "localising, to map on once the place is known"
    robot.set_pose(Pose2(x_m=0.45, y_m=0.25))
    for _ in range(3):
        robot.update(Pose2(), scan, STILL)
    assert robot.localizer is None
    assert robot.mode == "mapping"
    assert robot.quality().lost == ""


NEXT_DOOR = np.concatenate((rectangle(20.0, -2.0, 24.5, 1.5), rectangle(21.0, 0.4, 21.8, 0.9)))


def test_a_session_is_not_mapped_on_from_a_place_outside_it() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(GRID), None)
    path = way(Pose2(x_m=22.0, y_m=-0.5), 40)
    odometry, rng = Pose2(), np.random.default_rng(5)
    for before, pose in itertools.pairwise([path[0], *path]):
        odometry = odometry @ before.inverse() @ pose
        update = robot.update(odometry, room_scan(pose, noise_m=0.01, rng=rng, walls=NEXT_DOOR), STILL)
        assert not update.integrated
        assert robot.quality().lost


def test_a_session_is_mapped_on_only_after_some_way_at_the_place_that_was_found() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(GRID), None)
    path = [Pose2(x_m=0.1 * k - 0.8, y_m=0.3, theta_rad=0.2) for k in range(16)]
    mapping = []
    for k, pose in enumerate(path):
        robot.update(Pose2(x_m=0.1 * k), room_scan(pose), STILL)
        mapping.append(robot.localizer is None)
    assert robot.quality().lost == ""
    assert not any(mapping[:10])
    assert mapping[12]


def test_who_asks_to_localise_keeps_the_map_of_another_day_as_it_is() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(GRID), Pose2())
    robot.localize()
    drive(robot, way(Pose2(), 5), Pose2())
    assert robot.localizer is not None


def test_where_places_look_alike_the_pose_is_not_called_known() -> None:
    square = np.concatenate((rectangle(-2.0, -2.0, 2.0, 2.0), rectangle(4.0, -2.0, 8.0, 2.0)))
    grid = World(segments_m=square, circles_m=np.zeros((0, 3))).to_grid()
    localiser = Amcl(grid)
    localiser.update(Pose2(), room_scan(Pose2(x_m=0.4, y_m=0.3), walls=square), STILL)
    assert "several places" in localiser.quality().lost


@pytest.mark.parametrize("deed", ["set_pose", "relocalize"])
def test_what_needs_a_saved_map_says_so(deed: str) -> None:
    robot = SlamModeSwitch(GridMapper())
    with pytest.raises(ThumperError, match="localise first"):
        robot.set_pose(Pose2()) if deed == "set_pose" else robot.relocalize()
    with pytest.raises(ThumperError, match="no wall in the map"):
        robot.localize_in(replace(GRID, cells=np.zeros((9, 9), np.int8)), None)
    with pytest.raises(ThumperError, match="no wall in the map"):
        robot.localize()  # before anything was mapped
    assert robot.localizer is None
