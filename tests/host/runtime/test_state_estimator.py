"""The state estimator joins odometry and scans by time, whichever arrives first."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.telemetry import telemetry_sample

from thumper.board.board import TelemetrySample
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.kinematics import DriveGeometry
from thumper.gps.earth_reference import EarthReference, MapDatum
from thumper.gps.fix import Fix, FixStatus
from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane
from thumper.gps.options import GpsOptions
from thumper.imu.options import ImuOptions
from thumper.imu.sample import ImuSample
from thumper.lidar.scan import Scan
from thumper.lidar.scan_checks import ScanDefect
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.mode_switch import SlamModeSwitch
from thumper_hil.world.world import World

DRIVE = DriveGeometry()
M_PER_COUNT = DRIVE.rad_per_count * DRIVE.wheel_radius_m
LASER = Pose2(x_m=0.12)
ROOM_M = (-1.5, 2.5, -1.0, 1.4)  # x from ... to, y from ... to


def telemetry(time_s: float, left_count: int, right_count: int) -> TelemetrySample:
    return telemetry_sample(time_s, left_count=left_count, right_count=right_count)


def room_range_m(pose: Pose2, angle_rad: float) -> float:
    """Return the distance to the walls of the rectangular room, in closed form."""
    x_lo, x_hi, y_lo, y_hi = ROOM_M
    cos, sin = math.cos(pose.theta_rad + angle_rad), math.sin(pose.theta_rad + angle_rad)
    along_x = ((x_hi if cos > 0 else x_lo) - pose.x_m) / cos if cos else math.inf
    along_y = ((y_hi if sin > 0 else y_lo) - pose.y_m) / sin if sin else math.inf
    return min(along_x, along_y)


def scan(time_s: float, base_at: list[Pose2]) -> Scan:
    """Return one revolution of 100 ms; beam i is measured from `base_at[i]`."""
    n = len(base_at)
    increment_rad = math.radians(240) / n
    ranges_m = np.array(
        [room_range_m(pose @ LASER, -math.radians(120) + i * increment_rad) for i, pose in enumerate(base_at)]
    )
    return Scan(
        time_s=time_s,
        ranges_m=ranges_m,
        angle_min_rad=-math.radians(120),
        angle_increment_rad=increment_rad,
        time_increment_s=0.1 / n,
    )


def wall_distance_m(points_m: FloatArray) -> FloatArray:
    x_lo, x_hi, y_lo, y_hi = ROOM_M
    x, y = points_m.T
    return np.asarray(np.abs(np.stack([x - x_lo, x - x_hi, y - y_lo, y - y_hi])).min(axis=0))


def perception() -> StateEstimator:
    return StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=GridMapper(base_from_laser=LASER))


def test_nothing_is_known_before_the_first_telemetry() -> None:
    assert perception().state() is None


def test_a_scan_waits_until_odometry_covers_it() -> None:
    robot = perception()
    robot.add_telemetry(telemetry(0.0, 0, 0))
    robot.add_scan(scan(0.05, [Pose2()] * 100))
    robot.add_telemetry(telemetry(0.1, 0, 0))
    assert robot.scans_mapped == 0
    robot.add_telemetry(telemetry(0.2, 0, 0))
    assert robot.scans_mapped == 1
    state = robot.state()
    assert state is not None
    assert state.scan_age_s == pytest.approx(0.2 - 0.149, abs=1e-7)


def test_a_scan_from_before_the_first_telemetry_is_not_mapped() -> None:
    robot = perception()
    robot.add_telemetry(telemetry(5.0, 0, 0))
    robot.add_scan(scan(1.0, [Pose2()] * 100))
    assert robot.scans_mapped == 0


def test_hits_of_a_turning_robot_are_on_the_walls() -> None:
    """At 1 rad/s the last beam is 5.7 degrees off; without de-skewing, hits would be 0.2 m off."""
    robot = perception()
    turn_counts = round(1.0 * 0.5 * DRIVE.track_m / M_PER_COUNT * 0.1)  # per 0.1 s, each side
    w_rad_s = 2 * turn_counts * M_PER_COUNT / DRIVE.track_m / 0.1
    for k in range(4):
        robot.add_telemetry(telemetry(0.1 * k, -k * turn_counts, k * turn_counts))
    poses = [Pose2(theta_rad=w_rad_s * (0.1 + 0.1 * i / 100)) for i in range(100)]
    robot.add_scan(scan(0.1, poses))
    state = robot.state()
    assert state is not None
    room_from_map = poses[0]  # the map origin is the pose of the first scan
    assert wall_distance_m(room_from_map.apply(state.hits_in_map_m)).max() < 0.01


def test_a_scan_from_the_future_does_not_delay_the_others() -> None:
    robot = perception()
    for k in range(30):
        robot.add_telemetry(telemetry(0.1 * k, 0, 0))
        robot.add_scan(scan(100.0 if k == 10 else 0.1 * k - 0.1, [Pose2()] * 100))
    robot.add_telemetry(telemetry(3.0, 0, 0))
    assert robot.scan_checker.counts == {
        ScanDefect.NO_ODOMETRY: 1,  # the first one, from before the first telemetry
        ScanDefect.GAP: 1,
        ScanDefect.BACKWARDS: 1,
        ScanDefect.WAITED: 1,
    }
    assert robot.scans_mapped == 28


def test_scans_without_telemetry_are_counted() -> None:
    robot = perception()
    robot.add_telemetry(telemetry(0.0, 0, 0))
    for k in range(40):
        robot.add_scan(scan(0.1 * k, [Pose2()] * 100))
    robot.add_telemetry(telemetry(4.1, 0, 0))
    counts = robot.scan_checker.counts
    assert counts.keys() == {ScanDefect.WAITED, ScanDefect.NO_ODOMETRY} or counts.keys() == {
        ScanDefect.WAITED
    }
    assert robot.scans_mapped + sum(counts.values()) == 40


@pytest.mark.parametrize(
    ("broken", "flaw"),
    [
        ({"time_s": math.nan}, ScanDefect.STAMP),
        ({"time_s": math.inf}, ScanDefect.STAMP),
        ({"time_s": 1e300}, ScanDefect.STAMP),
        ({"ranges_m": np.empty(0)}, ScanDefect.BEAMS),
        ({"angle_increment_rad": math.nan}, ScanDefect.BEAMS),
        ({"angle_min_rad": 1e300}, ScanDefect.BEAMS),
        ({"ranges_m": np.full(100, math.nan)}, ScanDefect.EMPTY),
        ({"ranges_m": np.full(100, -1.0)}, ScanDefect.EMPTY),
        ({"range_max_m": math.nan}, ScanDefect.EMPTY),
    ],
)
def test_an_invalid_scan_is_counted_and_harmless(broken: dict[str, Any], flaw: ScanDefect) -> None:
    robot = perception()
    for k in range(8):
        robot.add_telemetry(telemetry(0.1 * k, 0, 0))
        good = scan(0.1 * k, [Pose2()] * 100)
        robot.add_scan(replace(good, **broken) if k == 4 else good)
    robot.add_telemetry(telemetry(0.9, 0, 0))
    assert robot.scan_checker.counts == {flaw: 1}
    assert list(robot.warnings().values()) == [f"1 of 8 scans {flaw.value}"]
    state = robot.state()
    assert state is not None
    assert state.map_from_base.distance_m(Pose2()) < 0.01


def test_a_pose_set_by_the_user_is_not_slip() -> None:
    """The room is symmetric under a half turn, and the user sets that pose."""
    mapper = SlamModeSwitch(GridMapper(base_from_laser=LASER), base_from_laser=LASER)
    robot = StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=mapper)
    step = round(0.05 / M_PER_COUNT)  # counts in 0.1 s
    for k in range(30):
        robot.add_telemetry(telemetry(0.1 * k, step * k, step * k))
        begin_m, step_m = (k - 1) * step * M_PER_COUNT - 0.7, step * M_PER_COUNT
        robot.add_scan(scan(0.1 * k - 0.1, [Pose2(x_m=begin_m + step_m * i / 100) for i in range(100)]))
        if k == 15:
            here = mapper.map_from_odom @ Pose2(x_m=begin_m + 0.7)
            mapper.localize()
            for _ in range(2):  # the incomplete map contradicts the first
                mapper.set_pose(Pose2(x_m=2.4 - here.x_m, y_m=0.4 - here.y_m, theta_rad=math.pi))
    state = robot.state()
    assert state is not None
    assert abs(state.map_from_base.theta_rad) > 3.0
    assert state.lost == ""
    assert robot.scans_mapped == 29
    before_the_first_telemetry = f"1 of 30 scans {ScanDefect.NO_ODOMETRY}"
    assert robot.warnings() == {"NO_ODOMETRY": before_the_first_telemetry}


def test_count_jumps_are_reported_and_are_not_motion() -> None:
    robot = perception()
    leap = round(30.0 / M_PER_COUNT)
    for k in range(20):
        count = leap if k >= 10 else 0
        robot.add_telemetry(telemetry(0.1 * k, count, count))
        robot.add_scan(scan(0.1 * k, [Pose2()] * 100))
        state = robot.state()
        assert state is not None
        assert state.twist.v_m_s == 0.0
        assert state.map_from_base.distance_m(Pose2()) < 0.01
    assert robot.driven_m == pytest.approx(0.0, abs=1e-9)
    assert robot.warnings()["LEAP"].startswith("the odometry jumped once, by up to 30.0 m:")


def test_scans_are_mapped_again_after_a_clock_was_set_back() -> None:
    robot = perception()
    for k in range(60):
        time_s = 0.1 * k + (100.0 if k < 30 else 0.0)
        robot.add_telemetry(telemetry(time_s, 0, 0))
        if k == 30:
            state = robot.state()
            assert state is not None
            assert state.scan_age_s == math.inf  # older scans do not count
        robot.add_scan(scan(time_s, [Pose2()] * 100))
    assert robot.scans_mapped >= 56
    assert robot.scan_checker.counts[ScanDefect.BACKWARDS] == 1
    state = robot.state()
    assert state is not None
    assert 0.0 <= state.scan_age_s < 0.5


def test_a_wrong_map_is_reported() -> None:
    mapper = SlamModeSwitch(GridMapper(base_from_laser=LASER), base_from_laser=LASER)
    foreign = np.array([[-6.0, -0.4, 6.0, -0.4], [-6.0, 0.9, 6.0, 0.9], [0.5, -0.4, 0.5, 0.1]])
    mapper.localize_in(World(segments_m=foreign, circles_m=np.zeros((0, 3))).to_grid(), None)
    robot = StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=mapper)
    step = round(0.05 / M_PER_COUNT)
    for k in range(60):  # rotates in place
        robot.add_telemetry(telemetry(0.1 * k, -step * k, step * k))
        turn_rad = 2.0 * step * k * M_PER_COUNT / DRIVE.track_m
        robot.add_scan(scan(0.1 * k, [Pose2(theta_rad=turn_rad)] * 100))
    assert any("is it the right one" in line for line in robot.warnings().values())


class Doubting(GridMapper):
    """A mapper that doubts its map for a while."""

    map_doubt = ""


def test_the_doubt_about_the_map_ends_with_its_reason_but_is_reported_at_the_end() -> None:
    mapper = Doubting(base_from_laser=LASER)
    estimator = StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=mapper)
    seen = []
    for k, doubt in enumerate(("", "the map explains only 20 % of the scan", "")):
        mapper.map_doubt = doubt
        estimator.add_telemetry(telemetry(0.2 * k, 0, 0))
        estimator.add_scan(scan(0.2 * k, [Pose2()] * 200))
        estimator.add_telemetry(telemetry(0.2 * k + 0.1, 0, 0))
        seen.append(estimator.map_doubt)
    assert seen == ["", "the map explains only 20 % of the scan", ""]
    assert estimator.warnings()["MAP"] == seen[1]


class RecordsTurnStd(GridMapper):
    """Keeps what the state estimator says about each turn."""

    def __init__(self) -> None:
        super().__init__(base_from_laser=LASER)
        self.turn_std_rad: list[float] = []

    def update(self, *args: Any, turn_std_rad: float = math.inf) -> MapperUpdate:
        self.turn_std_rad.append(turn_std_rad)
        return super().update(*args, turn_std_rad=turn_std_rad)


@pytest.mark.parametrize("has_gyroscope", [False, True])
def test_the_error_of_a_turn_counts_from_the_newest_matched_scan(has_gyroscope: bool) -> None:
    mapper = RecordsTurnStd()
    imu = ImuOptions(enabled=has_gyroscope)
    robot = StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=mapper, imu=imu)
    counts = 20
    for k in range(60):
        time_s = 0.1 * k
        for step in range(10):
            robot.add_imu(ImuSample(time_s=time_s - 0.1 + 0.01 * step, yaw_rate_rad_s=0.0))
        robot.add_telemetry(telemetry(time_s, counts * k, counts * k))
        seen = scan(time_s - 0.15, [Pose2(x_m=counts * M_PER_COUNT * (k - 1.5))] * 100)
        is_blind = 20 <= k < 50  # nothing returns
        robot.add_scan(replace(seen, ranges_m=np.full(100, np.nan)) if is_blind else seen)
    if not has_gyroscope:
        assert set(mapper.turn_std_rad) == {math.inf}
        return
    matched, blind, again = mapper.turn_std_rad[5:18], mapper.turn_std_rad[20:46], mapper.turn_std_rad[-6:]
    assert max(matched) < 0.003
    assert blind == sorted(blind)
    assert blind[-1] > 3.0 * max(matched)
    assert max(again) < 0.003


def rtk(time_s: float, place: LatLon) -> Fix:
    variances_m2 = (1e-4, 1e-4, 1e-3)
    return Fix(time_s=time_s, status=FixStatus.RTK, variances_m2=variances_m2, **place._asdict())


class AlongWall(GridMapper):
    """Matches each scan to a wall that does not fix the position."""

    def update(self, odom_from_base: Pose2, *_: Any, **__: Any) -> MapperUpdate:
        return MapperUpdate(map_from_base=odom_from_base, match_score=0.9, integrated=True)

    def quality(self) -> PoseQuality:
        return PoseQuality(covariance=np.eye(3), explained=0.9, lost="no wall", has_drifted=True)


def test_a_correction_by_gps_is_not_blamed_on_the_wheels() -> None:
    """The map's datum says that the robot is half a metre beside the pose that it started with."""
    earth = EarthReference(GpsOptions(), MapDatum(48.0, 11.0, 0.0))
    robot = StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=AlongWall(), earth=earth)
    plane, counts = LocalPlane(LatLon(48.0, 11.0)), round(0.1 / M_PER_COUNT)
    for k in range(100):
        time_s = 0.2 * k
        robot.add_telemetry(telemetry(time_s, counts * k, counts * k))
        robot.add_scan(scan(time_s - 0.15, [Pose2()] * 100))
        robot.add_fix(rtk(time_s, plane.to_earth(EastNorth(counts * k * M_PER_COUNT, 0.5))))
    assert robot.map_from_odom.y_m == pytest.approx(0.5, abs=0.1)
    assert "SLIP" not in robot.warnings()


class Lost(AlongWall):
    """Knows its pose until `lost` says why it does not; then it estimates one 5 m away."""

    lost = ""

    @property
    def map_from_odom(self) -> Pose2:
        return Pose2(x_m=5.0) if self.lost else Pose2()

    def quality(self) -> PoseQuality:
        return PoseQuality(covariance=1e-4 * np.eye(3), explained=0.9, lost=self.lost)


def test_a_lost_robot_does_not_move_the_map_on_earth() -> None:
    earth, mapper = EarthReference(GpsOptions()), Lost()
    robot = StateEstimator(drive=DRIVE, base_from_laser=LASER, mapper=mapper, earth=earth)
    plane, counts = LocalPlane(LatLon(48.0, 11.0)), round(0.1 / M_PER_COUNT)
    found = []
    for mapper.lost, steps in (("", range(100)), ("carried away", range(100, 200))):
        for k in steps:
            robot.add_telemetry(telemetry(0.2 * k, counts * k, counts * k))
            robot.add_scan(scan(0.2 * k - 0.15, [Pose2()] * 100))
            robot.add_fix(rtk(0.2 * k, plane.to_earth(EastNorth(counts * k * M_PER_COUNT, 0.0))))
        datum = robot.map_datum()
        assert datum is not None
        found.append(plane.to_plane(LatLon(*datum[:2])))
    assert math.dist(*found) < 0.01


@pytest.mark.parametrize("has_gps", [False, True])
def test_on_open_ground_a_robot_is_lost_without_gps_only(has_gps: bool) -> None:
    """It drives 30 m east, and nothing returns."""
    earth = EarthReference(GpsOptions()) if has_gps else None
    robot = StateEstimator(
        drive=DRIVE, base_from_laser=LASER, mapper=GridMapper(base_from_laser=LASER), earth=earth
    )
    plane, counts = LocalPlane(LatLon(48.0, 11.0)), round(0.1 / M_PER_COUNT)
    for k in range(300):
        time_s = 0.2 * k
        robot.add_telemetry(telemetry(time_s, counts * k, counts * k))
        seen = scan(time_s - 0.15, [Pose2()] * 100)
        robot.add_scan(replace(seen, ranges_m=np.full(100, np.nan)) if k > 2 else seen)
        place = plane.to_earth(EastNorth(counts * k * M_PER_COUNT, 0.0))
        robot.add_fix(rtk(time_s, place))
    assert robot.mapper.quality().has_drifted
    state = robot.state()
    assert state is not None
    assert bool(state.lost) is not has_gps
