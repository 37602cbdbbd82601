"""Localization in a known map: global search, tracking, kidnapping, mode switches."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared.rooms import ROOM, rectangle, room_scan

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.localization.amcl import Amcl
from thumper.slam.localization.amcl_state import RETRY_SCANS, Schedule
from thumper.slam.mode_switch import SlamModeSwitch
from thumper.slam.scan_matching.pose_trust import PoseTrust
from thumper_hil.world.world import World

STILL = Twist2()
GRID = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()


def drive(
    localizer: Amcl | SlamModeSwitch,
    path: list[Pose2],
    odometry: Pose2,
    slip: float = 0.1,
    walls: FloatArray = ROOM,
) -> Pose2:
    """Drive from pose to pose with odometry that reads too large; return the final odometry."""
    rng = np.random.default_rng(3)
    for before, pose in itertools.pairwise(path):
        step = before.inverse() @ pose
        odometry = odometry @ Pose2(
            x_m=(1 + slip) * step.x_m, y_m=step.y_m, theta_rad=(1 + slip) * step.theta_rad
        )
        localizer.update(odometry, room_scan(pose, noise_m=0.01, rng=rng, walls=walls), STILL)
    return odometry


def arc(start: Pose2, steps: int = 15) -> list[Pose2]:
    """Return poses along an arc, 0.08 m and 0.15 rad per step."""
    path = [start]
    for _ in range(steps):
        path.append(path[-1] @ Pose2(x_m=0.08, theta_rad=0.15))
    return path


def error_m(localizer: Amcl, truth: Pose2) -> float:
    assert abs(wrap_angle(localizer.map_from_base.theta_rad - truth.theta_rad)) < 0.05
    return localizer.map_from_base.distance_m(truth)


@pytest.mark.parametrize(("x_m", "y_m", "theta_rad"), [(0.3, 0.4, 2.0), (-1.5, 2.0, -1.0), (2.2, -0.8, 3.0)])
def test_global_localization_finds_the_pose(x_m: float, y_m: float, theta_rad: float) -> None:
    start = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    localizer = Amcl(GRID)
    assert localizer.quality().lost
    localizer.update(Pose2(), room_scan(start), STILL)
    assert error_m(localizer, start) < 0.05
    path = arc(start, 8)
    drive(localizer, path, Pose2())  # from one place the room rotated by 180 degrees looks nearly the same
    assert error_m(localizer, path[-1]) < 0.05
    assert localizer.relocalizations == 1
    assert localizer.quality().lost == ""


def test_a_search_says_that_it_goes_on_though_the_newest_scan_fits() -> None:
    localizer = Amcl(GRID, map_from_base=Pose2(x_m=0.3))
    localizer.update(Pose2(), room_scan(Pose2(x_m=0.3)), STILL)
    assert localizer.quality().lost == ""
    localizer._schedule.search = True  # as after a rejected place
    assert localizer.quality().lost == "the whole map is searched for the pose"


def test_given_pose_is_refined_and_tracked_with_fewer_particles() -> None:
    start = Pose2(x_m=0.2, y_m=0.3)
    localizer = Amcl(GRID, map_from_base=Pose2(x_m=0.4, y_m=0.1, theta_rad=0.15))
    before, before_particles = localizer.quality(), localizer.particles
    path = arc(start)
    localizer.update(Pose2(), room_scan(start), STILL)
    drive(localizer, path, Pose2())
    after = localizer.quality()
    assert error_m(localizer, path[-1]) < 0.05
    assert localizer.particles < 0.3 * before_particles
    assert after.std_m < 0.1 < before.std_m
    assert after.explained > 0.7
    assert localizer.relocalizations == 0


PLAIN = np.concatenate((rectangle(-4.0, -2.5, 4.0, 2.5), rectangle(3.0, 1.9, 4.0, 2.5)))  # with a cupboard
PLAIN_GRID = World(segments_m=PLAIN, circles_m=np.zeros((0, 3))).to_grid()
STARTS = [Pose2(x_m=1.0, y_m=0.5, theta_rad=0.3), Pose2(x_m=-1.2, y_m=-0.8, theta_rad=2.5)]


@pytest.mark.parametrize("true", STARTS)
def test_start_rotated_by_180_degrees_is_not_trusted(true: Pose2) -> None:
    localizer = Amcl(
        PLAIN_GRID, map_from_base=Pose2(x_m=-true.x_m, y_m=-true.y_m, theta_rad=true.theta_rad + 3)
    )
    localizer.update(Pose2(), room_scan(true, walls=PLAIN), STILL)
    assert localizer.quality().lost or error_m(localizer, true) < 0.05  # no drive starts
    path = arc(true, 8)
    drive(localizer, path, Pose2(), walls=PLAIN)
    assert error_m(localizer, path[-1]) < 0.05
    assert localizer.quality().lost == ""


def test_wrong_start_is_replaced_once_visible_walls_contradict_it() -> None:
    """A lidar of 3 m sees the cupboard in the corner only after some steps."""
    true = Pose2(x_m=-2.0, y_m=0.3, theta_rad=0.1)
    path = [true @ Pose2(x_m=0.15 * k) for k in range(28)]
    scans = [room_scan(pose, walls=PLAIN) for pose in path]
    near = [replace(scan, ranges_m=np.where(scan.ranges_m > 3.0, np.nan, scan.ranges_m)) for scan in scans]
    localizer = Amcl(PLAIN_GRID, map_from_base=Pose2(x_m=2.0, y_m=-0.3, theta_rad=0.1 + math.pi))
    correct = []
    for k, scan in enumerate(near):
        localizer.update(Pose2(x_m=0.15 * k), scan, STILL)
        correct.append(localizer.map_from_base.distance_m(path[k]) < 0.2)
        assert localizer.quality().lost == ""
    assert not correct[0]
    assert correct[-1]
    assert error_m(localizer, path[-1]) < 0.05


def test_pose_given_twice_is_trusted() -> None:
    true, given = STARTS[0], Pose2(x_m=-1.0, y_m=-0.5, theta_rad=0.3 - math.pi)
    localizer = Amcl(PLAIN_GRID, map_from_base=given)
    localizer.update(Pose2(), room_scan(true, walls=PLAIN), STILL)
    localizer.set_pose(given @ Pose2(x_m=0.1))
    localizer.update(Pose2(), room_scan(true, walls=PLAIN), STILL)
    assert localizer.map_from_base.distance_m(given) < 0.1


@pytest.mark.parametrize("moved", [[], [(0.2, 1.2, 0.8, 1.7)]])  # an object added since the map was made
@pytest.mark.parametrize("off", [(0.1, 3.0), (0.5, 20.0)])
@pytest.mark.parametrize("true", STARTS)
def test_rough_but_correct_start_is_trusted_at_once(
    true: Pose2, off: tuple[float, float], moved: list[tuple[float, float, float, float]]
) -> None:
    walls = np.concatenate((PLAIN, *(rectangle(*box) for box in moved)))
    for direction_rad, sign in itertools.product((0.0, 2.0, 4.0), (-1.0, 1.0)):
        slip = Pose2(x_m=off[0] * math.cos(direction_rad), y_m=off[0] * math.sin(direction_rad))
        given = true @ slip @ Pose2(theta_rad=sign * math.radians(off[1]))
        localizer = Amcl(PLAIN_GRID, map_from_base=given, std_m=0.1, std_rad=0.05)
        localizer.update(Pose2(), room_scan(true, walls=walls), STILL)
        assert localizer.quality().lost == ""
        assert error_m(localizer, true) < 0.05


def test_map_doubt_is_reported_for_the_wrong_map_only() -> None:
    path = arc(Pose2(x_m=0.2, y_m=0.3), 30)
    for grid, doubt in ((GRID, ""), (PLAIN_GRID, "the map explains only")):
        localizer = Amcl(grid)
        localizer.update(Pose2(), room_scan(path[0]), STILL)
        assert localizer.map_doubt == ""  # one scan is not enough
        drive(localizer, path, Pose2())
        assert localizer.map_doubt.startswith(doubt)
        assert bool(localizer.map_doubt) == bool(doubt)


def test_kidnapped_robot_reports_lost_and_relocalizes() -> None:
    start = Pose2(x_m=0.2, y_m=0.3)
    localizer = Amcl(GRID, map_from_base=start)
    localizer.update(Pose2(), room_scan(start), STILL)
    odometry = drive(localizer, arc(start, 5), Pose2())
    elsewhere = arc(Pose2(x_m=2.3, y_m=-0.9, theta_rad=2.5))
    lost = ""
    for here, there in itertools.pairwise(elsewhere):
        odometry = drive(localizer, [here, there], odometry)
        lost = lost or localizer.quality().lost
    assert lost
    assert localizer.relocalizations >= 1
    assert error_m(localizer, elsewhere[-1]) < 0.06


def test_wrongly_placed_robot_relocalizes_while_stationary() -> None:
    """A lost robot is not driven, so it must relocalize while stationary."""
    true = Pose2(x_m=0.3, y_m=0.4, theta_rad=2.0)
    localizer = Amcl(GRID, map_from_base=Pose2(x_m=-1.0, y_m=1.5))
    for _ in range(30):
        localizer.update(Pose2(), room_scan(true), STILL)
    assert error_m(localizer, true) < 0.05
    assert localizer.quality().explained > 0.7


def test_stationary_robot_keeps_pose_and_particles() -> None:
    start = Pose2(x_m=0.2, y_m=0.3)
    localizer = Amcl(GRID, map_from_base=start)
    rng = np.random.default_rng(4)
    localizer.update(Pose2(), room_scan(start, noise_m=0.02, rng=rng), STILL)
    pose, quality = localizer.map_from_base, localizer.quality()
    for _ in range(30):
        localizer.update(Pose2(), room_scan(start, noise_m=0.02, rng=rng), STILL)
    assert localizer.map_from_base == pose
    np.testing.assert_array_equal(localizer.quality().covariance, quality.covariance)


@pytest.mark.parametrize("push", [Pose2(theta_rad=math.radians(4.0)), Pose2(x_m=0.06, y_m=-0.06)])
def test_a_push_that_odometry_does_not_show_is_seen(push: Pose2) -> None:
    pose = Pose2(x_m=0.3, y_m=0.4, theta_rad=2.0)
    localizer = Amcl(GRID, map_from_base=pose)
    odometry = drive(localizer, arc(pose), Pose2())
    pushed = arc(pose)[-1] @ push
    for _ in range(3):
        localizer.update(odometry, room_scan(pushed, noise_m=0.01, rng=np.random.default_rng(1)), STILL)
    assert error_m(localizer, pushed) < 0.02
    assert abs(wrap_angle(localizer.map_from_base.theta_rad - pushed.theta_rad)) < math.radians(0.5)
    assert localizer.quality().lost == ""


def test_localization_does_not_change_the_map() -> None:
    before = GRID.cells.copy()
    localizer = Amcl(GRID, map_from_base=Pose2())
    drive(localizer, arc(Pose2()), Pose2())
    np.testing.assert_array_equal(localizer.grid().cells, before)


def test_invalid_scan_moves_the_pose_by_odometry() -> None:
    localizer = Amcl(GRID, map_from_base=Pose2(x_m=1.0))
    blind = Scan(time_s=0.0, ranges_m=np.full(90, np.nan), angle_min_rad=0.0, angle_increment_rad=0.07)
    localizer.update(Pose2(), room_scan(Pose2(x_m=1.0)), STILL)
    pose = localizer.map_from_base
    update = localizer.update(Pose2(x_m=0.3), blind, STILL)
    assert math.isnan(update.match_score)
    assert update.map_from_base.distance_m(pose @ Pose2(x_m=0.3)) < 1e-9


def test_mode_switches_do_not_move_the_pose() -> None:
    path = arc(Pose2(), 30)
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


def test_mapping_does_not_resume_from_a_lost_pose() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.update(Pose2(), room_scan(Pose2()), STILL)
    robot.localize()
    assert robot.localizer is not None
    robot.localizer.relocalize()
    with pytest.raises(ThumperError, match="spoil the map"):
        robot.resume_mapping()


def _same(grid: OccupancyGrid, cells: FloatArray | np.ndarray[tuple[int, int], np.dtype[np.int8]]) -> bool:
    return grid.cells.shape == cells.shape and bool((grid.cells == cells).all())


def test_localize_in_saved_map_and_resume_mapping() -> None:
    path = arc(Pose2(), 20)
    robot = SlamModeSwitch(GridMapper())
    robot.update(Pose2(x_m=5.0), room_scan(path[0]), STILL)
    robot.localize_in(GRID, Pose2(x_m=0.05, y_m=-0.05))
    assert (robot.map_from_odom @ Pose2(x_m=5.0)).distance_m(Pose2()) < 0.1  # immediately, without a scan
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


@pytest.mark.parametrize("given", [Pose2(x_m=0.05, y_m=-0.05), None])
def test_mapping_resumes_in_saved_counts(given: Pose2 | None) -> None:
    """A box was removed since; the robot starts at another place."""
    box = np.concatenate((ROOM, rectangle(0.6, -0.3, 0.9, 0.0)))
    old_start = Pose2(y_m=0.8, theta_rad=1.0)
    before = GridMapper(map_from_base=old_start)
    for pose in arc(old_start, 30):
        before.update(pose, room_scan(pose, walls=box), STILL)
    counts = before.counts()
    robot, path = SlamModeSwitch(GridMapper()), arc(Pose2(), 60)
    robot.resume_from(counts, given)
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


def test_mapping_does_not_resume_before_the_pose_is_known() -> None:
    square = np.concatenate((rectangle(-2.0, -2.0, 2.0, 2.0), rectangle(4.0, -2.0, 8.0, 2.0)))
    grid = World(segments_m=square, circles_m=np.zeros((0, 3))).to_grid()
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(grid), None)
    scan = room_scan(Pose2(x_m=0.4, y_m=0.3), walls=square)
    for _ in range(3):
        assert not robot.update(Pose2(), scan, STILL).integrated
    assert "several places" in robot.quality().lost
    assert robot.mode == "localizing, resumes mapping after localization"
    robot.set_pose(Pose2(x_m=0.45, y_m=0.25))
    for _ in range(3):
        robot.update(Pose2(), scan, STILL)
    assert robot.localizer is None
    assert robot.mode == "mapping"
    assert robot.quality().lost == ""


NEXT_DOOR = np.concatenate((rectangle(20.0, -2.0, 24.5, 1.5), rectangle(21.0, 0.4, 21.8, 0.9)))


def test_mapping_does_not_resume_outside_the_saved_map() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(GRID), None)
    path = arc(Pose2(x_m=22.0, y_m=-0.5), 40)
    odometry, rng = Pose2(), np.random.default_rng(5)
    for before, pose in itertools.pairwise([path[0], *path]):
        odometry = odometry @ before.inverse() @ pose
        update = robot.update(odometry, room_scan(pose, noise_m=0.01, rng=rng, walls=NEXT_DOOR), STILL)
        assert not update.integrated
        assert robot.quality().lost


def test_mapping_resumes_only_after_a_found_place_is_confirmed() -> None:
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


def test_localize_cancels_resuming() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(GRID), Pose2())
    robot.localize()
    drive(robot, arc(Pose2(), 5), Pose2())
    assert robot.localizer is not None


@pytest.mark.parametrize("start", [None, Pose2()])
def test_open_ground_is_not_blamed_on_the_map(start: Pose2 | None) -> None:
    localizer = Amcl(GRID, map_from_base=start)
    scan = room_scan(Pose2())
    few_m = np.where(np.arange(scan.ranges_m.size) < 4, scan.ranges_m, np.inf)
    localizer.update(Pose2(), replace(scan, ranges_m=few_m), STILL)
    assert "only 4 beams of the scan return" in localizer.quality().lost


def test_pose_is_lost_if_places_look_alike() -> None:
    square = np.concatenate((rectangle(-2.0, -2.0, 2.0, 2.0), rectangle(4.0, -2.0, 8.0, 2.0)))
    grid = World(segments_m=square, circles_m=np.zeros((0, 3))).to_grid()
    localizer = Amcl(grid)
    localizer.update(Pose2(), room_scan(Pose2(x_m=0.4, y_m=0.3), walls=square), STILL)
    assert "several places" in localizer.quality().lost


@pytest.mark.parametrize("call", ["set_pose", "relocalize"])
def test_calls_that_need_a_saved_map_are_refused(call: str) -> None:
    robot = SlamModeSwitch(GridMapper())
    reason = "load a saved map" if call == "set_pose" else "localize first"
    with pytest.raises(ThumperError, match=reason):
        robot.set_pose(Pose2()) if call == "set_pose" else robot.relocalize()
    with pytest.raises(ThumperError, match="the map has no walls"):
        robot.localize_in(replace(GRID, cells=np.zeros((9, 9), np.int8)), None)
    with pytest.raises(ThumperError, match="the map has no walls"):
        robot.localize()  # before anything was mapped
    assert robot.localizer is None


def test_robot_that_leaves_the_map_and_returns_is_not_searched_for() -> None:
    """The map has the first of two rooms; the second is unknown, and has another size."""
    door = np.array([[6.0, 0.0, 6.0, 2.0], [6.0, 3.2, 6.0, 5.0]])
    outer = np.array(
        [
            [0, 0, 6, 0],
            [0, 5, 6, 5],
            [0, 0, 0, 5],
            [6, 0, 6, -2],
            [6, 5, 6, 7],
            [6, -2, 15, -2],
            [6, 7, 15, 7],
        ]
    )
    walls = np.concatenate(
        (
            door,
            outer,
            np.array([[15.0, -2.0, 15.0, 7.0]]),
            rectangle(1.0, 3.8, 2.2, 4.4),
            rectangle(9, 4, 10, 5),
        )
    )
    whole = World(segments_m=walls, circles_m=np.zeros((0, 3))).to_grid()
    cells = whole.cells.copy()
    cells[:, whole.cell_of(6.2, 1.0)[1] :] = UNKNOWN
    out = [Pose2(x_m=float(x_m), y_m=2.6) for x_m in np.arange(2.0, 12.0, 0.1)]
    localizer, rng = Amcl(replace(whole, cells=cells), map_from_base=out[0]), np.random.default_rng(3)
    lost, odometry = [], Pose2()
    for before, pose in itertools.pairwise([out[0], *out, *out[::-1]]):
        step = before.inverse() @ pose
        odometry = odometry @ Pose2(x_m=1.01 * step.x_m, y_m=step.y_m, theta_rad=step.theta_rad)
        scan = room_scan(pose, noise_m=0.01, rng=rng, walls=walls)
        near = replace(scan, ranges_m=np.where(scan.ranges_m < 4.0, scan.ranges_m, np.nan))
        localizer.update(odometry, near, STILL)
        lost.append(bool(localizer.quality().lost))
    assert not any(lost[5:30])
    assert all(lost[len(out) - 20 : len(out) + 20])  # more than 4 m outside
    assert not any(lost[-30:])
    assert localizer.relocalizations == 0
    assert error_m(localizer, out[0]) < 0.1


def test_where_places_look_alike_a_robot_is_where_it_was() -> None:
    """It was perhaps carried away, or people hid the walls: what the scans do not decide, odometry does."""
    walls = rectangle(-2.0, -1.0, 2.0, 1.0)
    pose, before = Pose2(x_m=1.0, y_m=0.3), Pose2(x_m=0.8, y_m=0.3)
    localizer = Amcl(World(segments_m=walls, circles_m=np.zeros((0, 3))).to_grid())
    localizer.set_likely_pose(before @ Pose2(x_m=5.0).inverse())
    localizer.update(Pose2(x_m=5.2), room_scan(pose, walls=walls), STILL)
    assert error_m(localizer, pose) < 0.05
    assert localizer.quality().lost == ""


def test_a_robot_that_was_carried_away_is_not_where_it_was() -> None:
    pose = Pose2(x_m=-1.5, y_m=2.0, theta_rad=-1.0)
    localizer = Amcl(GRID)
    localizer.set_likely_pose(Pose2(x_m=0.3))
    localizer.update(Pose2(), room_scan(pose), STILL)
    assert error_m(localizer, pose) < 0.05


def test_a_stationary_robot_looks_again_where_places_look_alike() -> None:
    """People who hid where the places differ may have left."""
    for trusted in (False, True):
        trust = PoseTrust(trusted=trusted)
        trust.update(0.9, 0.5, 0.0, 0.0)
        assert "several places look alike" in trust.doubt
        schedule = Schedule(search=False)
        for _ in range(RETRY_SCANS):
            schedule.next_scan(trust)
        assert schedule.search is not trusted
