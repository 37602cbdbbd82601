"""A robot that is carried away while it maps: nothing is inserted, and it is found again."""

import math

import numpy as np
import pytest
from benchmarks.shared.rooms import rectangle, room_scan

from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.kidnap_detector import SAME_VIEW, KidnapDetector
from thumper.slam.grid.view_change import shared_view
from thumper.slam.mode_switch import SlamModeSwitch
from thumper.slam.scan_matching.beam_evidence import BeamEvidence

STILL = Twist2()
BAD = BeamEvidence(supports=np.zeros(0), explained=0.3, fit=0.1, contradicting_share=0.5)
# 4.8 x 4 m with a cupboard, a table and a niche: no two places look alike.
ROOM = np.concatenate(
    (
        rectangle(-2.4, -2.0, 2.4, 2.0),
        rectangle(1.7, 0.9, 2.4, 2.0),
        rectangle(-0.9, -0.4, -0.3, 0.1),
        rectangle(-2.4, -2.0, -2.0, -1.1),
    )
)


def loop(start: Pose2, steps: int) -> list[Pose2]:
    """Return poses along a circle of 0.6 m radius."""
    step = Pose2(x_m=0.06, theta_rad=0.1)
    poses = [start]
    for _ in range(steps):
        poses.append(poses[-1] @ step)
    return poses


def drive(
    robot: SlamModeSwitch | GridMapper, poses: list[Pose2], odometry: Pose2, walls: FloatArray = ROOM
) -> tuple[Pose2, list[float], list[str]]:
    """Return odometry at the end, errors of the inserted scans, and the text `lost` at each scan."""
    rng, entered, lost = np.random.default_rng(3), [], []
    for k, pose in enumerate(poses):
        if k:
            odometry = odometry @ poses[k - 1].inverse() @ pose
        update = robot.update(odometry, room_scan(pose, noise_m=0.01, rng=rng, walls=walls), STILL)
        if update.integrated:
            entered.append(update.map_from_base.distance_m(pose))
        lost.append(robot.quality().lost)
    return odometry, entered, lost


SYMMETRIC = np.concatenate((rectangle(-2.4, -2.0, 2.4, 2.0), rectangle(-0.1, -0.1, 0.1, 0.1)))
PLACES = [Pose2(x_m=1.01, y_m=1.0, theta_rad=math.radians(-168.2)), Pose2(x_m=-1.2, y_m=0.9, theta_rad=1.0)]
ELSEWHERE = [
    Pose2(x_m=1.2, y_m=-1.2, theta_rad=2.0),
    Pose2(x_m=-1.5, y_m=1.2, theta_rad=-1.0),
    Pose2(x_m=1.2, y_m=0.2, theta_rad=-2.6),
    Pose2(x_m=-1.3, y_m=-1.0, theta_rad=0.7),
]


@pytest.mark.parametrize(
    "elsewhere", [ELSEWHERE[0], *(pytest.param(place, marks=pytest.mark.slow) for place in ELSEWHERE[1:])]
)
def test_carried_robot_enters_nothing_and_is_found_in_its_own_map(elsewhere: Pose2) -> None:
    start = Pose2(x_m=0.6, y_m=-1.0)
    robot = SlamModeSwitch(GridMapper(map_from_base=start))
    odometry, entered, lost = drive(robot, loop(start, 64), Pose2())
    assert not any(lost)
    assert max(entered) < 0.05
    _, entered, lost = drive(robot, loop(elsewhere, 40), odometry)
    assert any(lost[:4])  # the robot stops
    assert max(entered, default=0.0) < 0.1
    assert robot.mode == "mapping"
    assert robot.quality().lost == ""


@pytest.mark.slow
@pytest.mark.parametrize("elsewhere", some_of(PLACES))
def test_robot_carried_to_where_the_view_is_nearly_the_same_does_not_spoil_the_map(elsewhere: Pose2) -> None:
    """A room with a post in its middle looks the same after half a turn: that place is as good."""
    start, half_turn = Pose2(x_m=0.6, y_m=-1.0), Pose2(theta_rad=math.pi)
    robot = SlamModeSwitch(GridMapper(map_from_base=start))
    odometry, _, _ = drive(robot, loop(start, 64), Pose2(), SYMMETRIC)
    rng = np.random.default_rng(3)
    poses = loop(elsewhere, 40)
    for k, pose in enumerate(poses):
        odometry = odometry if k == 0 else odometry @ poses[k - 1].inverse() @ pose
        scan = room_scan(pose, noise_m=0.01, rng=rng, walls=SYMMETRIC)
        update = robot.update(odometry, scan, STILL)
        error_m = min(update.map_from_base.distance_m(place) for place in (pose, half_turn @ pose))
        assert error_m < 0.3 or not update.integrated


def test_robot_carried_out_of_its_map_says_so() -> None:
    start, other = Pose2(x_m=0.6, y_m=-1.0), rectangle(-3.0, -0.7, 3.0, 0.9)
    robot = SlamModeSwitch(GridMapper(map_from_base=start))
    odometry, _, _ = drive(robot, loop(start, 64), Pose2())
    for k in range(20):
        pose = Pose2(x_m=-2.0 + 0.1 * k, theta_rad=0.05 * k)
        update = robot.update(
            odometry @ Pose2(x_m=0.1 * k, theta_rad=0.05 * k), room_scan(pose, walls=other), STILL
        )
        assert not update.integrated
        if k >= 3:
            assert robot.quality().lost


def test_one_bad_scan_neither_stops_the_robot_nor_spoils_the_map() -> None:
    start = Pose2(x_m=0.6, y_m=-1.0)
    mapper = GridMapper(map_from_base=start)
    odometry, _, _ = drive(mapper, loop(start, 30), Pose2())
    bad = room_scan(Pose2(x_m=0.3, y_m=0.6, theta_rad=1.3), walls=0.7 * ROOM)
    before = mapper.counts().hits
    assert not mapper.update(odometry, bad, STILL).integrated
    assert mapper.quality().lost == ""
    np.testing.assert_array_equal(mapper.counts().hits, before)
    poses = loop(loop(start, 30)[-1], 10)
    _, entered, lost = drive(mapper, poses, odometry)
    assert not any(lost)
    assert entered
    assert max(entered) < 0.05


def test_scans_that_all_differ_are_bad_scans_and_no_kidnapped_robot() -> None:
    """A lidar that tilts on rough ground sees another cut of the place at each scan."""
    start = Pose2(x_m=0.6, y_m=-1.0)
    mapper = GridMapper(map_from_base=start)
    odometry, _, _ = drive(mapper, loop(start, 30), Pose2())
    for k in range(6):
        turned = Pose2(x_m=0.5 * (-1) ** k, y_m=0.6, theta_rad=1.3 * k)
        bad = room_scan(turned, walls=(0.5 + 0.1 * (k % 3)) * ROOM)
        assert not mapper.update(odometry, bad, STILL).integrated
        assert mapper.quality().lost == ""
    _, entered, lost = drive(mapper, loop(loop(start, 30)[-1], 10), odometry)
    assert not any(lost)
    assert max(entered) < 0.05


def test_shared_view_separates_a_step_from_another_place() -> None:
    start, step = ELSEWHERE[0], Pose2(x_m=0.2, theta_rad=0.3)
    scans = (start, start @ step, ELSEWHERE[1])
    before_m, after_m, other_m = (
        scan_points(room_scan(pose, walls=ROOM), STILL, Pose2(), 80.0).hits_m for pose in scans
    )
    assert shared_view(before_m, after_m, step) > 0.7
    assert shared_view(before_m, other_m, Pose2()) < SAME_VIEW


@pytest.mark.parametrize(("step_m", "doubtful"), [(0.2, True), (1.0, False)])
def test_bad_scans_in_a_row_are_a_doubt_only_if_they_are_near(step_m: float, doubtful: bool) -> None:
    """In a log with a scan for each metre each may show another room."""
    detector, hits_m = KidnapDetector(0.1, 0.1), np.zeros((0, 2))
    step = Pose2(x_m=step_m)
    for _ in range(3):
        detector.update(BAD, hits_m, step, step)
        assert detector.doubtful == doubtful


@pytest.mark.parametrize(("usual", "doubtful"), [(0.05, True), (0.3, False)])
def test_bad_scans_in_a_row_are_a_doubt_only_if_they_are_unusual(usual: float, doubtful: bool) -> None:
    """Among trees many beams contradict the map at a right pose, too."""
    detector, hits_m, step = KidnapDetector(0.1, 0.1), np.zeros((0, 2)), Pose2(x_m=0.2)
    for contradicting in (*5 * [usual], *3 * [0.5]):
        evidence = BAD._replace(contradicting_share=contradicting)
        detector.update(evidence, hits_m, step, step)
    assert detector.doubtful == doubtful


@pytest.mark.parametrize(
    ("matched_rad", "same_view", "suspect"), [(0.15, False, True), (-0.05, False, False), (0.15, True, False)]
)
def test_a_match_that_turns_against_odometry_is_suspect_unless_the_view_stays(
    matched_rad: float, same_view: bool, suspect: bool
) -> None:
    """A robot that rocks sees the floor in one scan: a line far ahead, which fits other walls of the map."""
    detector = KidnapDetector(0.1, 0.1)
    good = BeamEvidence(supports=np.zeros(0), explained=0.9, fit=0.8, contradicting_share=0.05)
    floor = BeamEvidence(supports=np.zeros(0), explained=0.7, fit=0.6, contradicting_share=0.02)
    post_m = Pose2(x_m=1.6).apply(0.1 * np.random.default_rng(1).normal(size=(40, 2)))
    for _ in range(6):
        detector.update(good, post_m, Pose2(), Pose2())
    moved, matched = Pose2(theta_rad=-0.12), Pose2(theta_rad=matched_rad)
    floor_m = np.column_stack((np.full(40, 4.8), np.linspace(-2.0, 2.0, 40)))
    detector.update(floor, moved.inverse().apply(post_m) if same_view else floor_m, moved, matched)
    assert detector.suspect == suspect
