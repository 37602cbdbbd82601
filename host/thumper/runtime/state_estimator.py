"""Odometry and SLAM: wheel counts and scans in, robot state out. Pure: no I/O, no clock.

Inputs are first rounded to the precision of a recording, so that a replay is identical bit for bit.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from thumper.board.board import TelemetrySample
from thumper.board.messages import Telemetry
from thumper.camera.frame import CameraFrame
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.common.stamps import rounded_s
from thumper.gps.earth_reference import EarthReference, MapDatum
from thumper.gps.fix import Fix
from thumper.gps.pose_check import GpsCheck
from thumper.imu.options import ImuOptions
from thumper.imu.sample import ImuSample
from thumper.lidar.deskew import scan_points
from thumper.lidar.floor_echoes import FloorEchoFilter
from thumper.lidar.scan import Scan
from thumper.lidar.scan_checks import ScanChecker, ScanDefect
from thumper.lidar.self_returns import SelfReturnFilter
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.state import ScanFrames
from thumper.odometry.drive_train import WheelTick
from thumper.odometry.drive_train_monitor import DriveTrainMonitor
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.jump_filter import JumpFilter
from thumper.odometry.pose_buffer import PoseBuffer
from thumper.odometry.slip_detector import GOOD_MATCH, SlipDetector
from thumper.odometry.wheel_odometry import OdometrySample, WheelOdometry
from thumper.runtime.tag_anchors import TagAnchors
from thumper.slam.mapper import AcceptsPositionPrior, Mapper, ReportsDoubt
from thumper.slam.mounting import MountCheck, describe

MAX_SCAN_WAIT_S = 1.0  # a scan waits this long for its odometry
MAX_WAITING_SCANS = 100  # limits memory if time stamps are wrong
UNMATCHED_DRIFT = 0.05  # of the odometry, per metre without a matched scan
UNUSABLE = {ScanDefect.STAMP, ScanDefect.BEAMS}


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """Input of the navigator: newest pose and speed, and the hits of the newest scan."""

    time_s: float
    map_from_base: Pose2
    twist: Twist2
    hits_in_map_m: FloatArray  # shape (n, 2)
    scan_age_s: float  # +inf before the first scan
    lost: str = ""  # why the pose cannot be trusted; empty if it can
    frames: ScanFrames | None = None  # of that scan; None before the first


def wheel_tick(telemetry: Telemetry) -> WheelTick:
    """Return the part of the telemetry that describes the wheels."""
    return WheelTick(
        time_us=telemetry.time_us,
        left_count=telemetry.left_count,
        right_count=telemetry.right_count,
        left_pwm=telemetry.left_pwm,
        right_pwm=telemetry.right_pwm,
        battery_V=telemetry.battery_mV / 1000.0,
    )


class StateEstimator:
    """Combines odometry and mapper: telemetry and scans in, `RobotState` out."""

    def __init__(
        self,
        *,
        drive: DriveGeometry,
        base_from_laser: Pose2,
        mapper: Mapper,
        imu: ImuOptions | None = None,
        self_returns: SelfReturnFilter | None = None,
        drive_train: DriveTrainMonitor | None = None,
        earth: EarthReference | None = None,
    ) -> None:
        self.mapper = mapper
        self.drive_train = drive_train
        self.earth = earth
        self.tags: TagAnchors | None = None
        self._frame: CameraFrame | None = None  # waits for the odometry at its time
        self._base_from_laser = base_from_laser
        self._self_returns = self_returns
        self._odometry: WheelOdometry | GyroEkf = WheelOdometry(drive)
        if imu is not None and imu.enabled:
            self._odometry = GyroEkf(drive, imu=imu)
        self.uses_board_gyroscope = imu is not None and imu.uses_board
        self.fix: Fix | None = None  # the newest, with or without a position
        self._gps_check = GpsCheck()
        self._jump_filter = JumpFilter()
        self._floor_echoes = FloorEchoFilter()
        self._slip_detector = SlipDetector()
        self.mount_check = MountCheck(base_from_laser)
        self._pose_buffer = PoseBuffer()
        self._corrected_from_odom = Pose2()  # by GPS, where no scan could be matched
        self._matched_at_m = 0.0  # `driven_m` at the newest matched scan
        self._newest: OdometrySample | None = None
        self._waiting: deque[Scan] = deque()
        self._hits_in_map_m = np.empty((0, 2))
        self._map_from_scan_base: Pose2 | None = None
        self._scan_time_s = -np.inf
        self._mapped_var_rad2 = 0.0  # of the odometry's heading at the newest scan in the map
        self.scan_checker = ScanChecker()
        self.scans_mapped = 0
        self.driven_m = 0.0  # by odometry: the pose in the map also jumps while the robot is stationary
        self.map_doubt = ""  # why the loaded map might be the wrong one; empty while it fits
        self._last_doubt = ""

    def add_telemetry(self, sample: TelemetrySample) -> None:
        """Advance the odometry."""
        telemetry = sample.telemetry
        if self.drive_train is not None:
            self.drive_train.add(wheel_tick(telemetry))
        time_s = rounded_s(sample.time_s)
        counts = (telemetry.left_count, telemetry.right_count)
        if isinstance(self._odometry, GyroEkf):
            gyro_rad = sample.gyro_increment_rad if self.uses_board_gyroscope else None
            raw = self._odometry.update(time_s, *counts, gyro_rad=gyro_rad)
        else:
            raw = self._odometry.update(time_s, *counts)
        jumps = self._jump_filter.jumps
        filtered = replace(raw, odom_from_base=self._jump_filter.filter(time_s, raw.odom_from_base))
        if self._newest is not None:
            self.driven_m += self._newest.odom_from_base.distance_m(filtered.odom_from_base)
        has_jumped = self._jump_filter.jumps != jumps
        self._newest = replace(filtered, twist=Twist2()) if has_jumped else filtered
        self._pose_buffer.add(self._newest)
        self._floor_echoes.add_speed(time_s, self._newest.twist.v_m_s)
        if self.earth is not None:
            self.earth.filter.predict(self._newest.odom_from_base, float(self._newest.covariance[2, 2]))
        self._map_covered_scans()
        self._look_at_frame()

    def add_imu(self, sample: ImuSample) -> None:
        """Add a gyroscope sample, before the telemetry that follows it; ignored unless enabled.

        The samples of the board's gyroscope are ignored, too: the telemetry brings its turn.
        """
        if isinstance(self._odometry, GyroEkf) and not self.uses_board_gyroscope:
            self._odometry.add_imu(sample.as_recorded())

    def add_fix(self, fix: Fix) -> None:
        """Add a fix of the GPS receiver; without matched scans the pose follows it."""
        self.fix = fix = fix.as_recorded()
        if self.earth is None:
            return
        prior = self.earth.prior(fix)
        if isinstance(self.mapper, AcceptsPositionPrior) and prior is not None:
            self.mapper.set_position_prior(prior)
        if not self._pose_buffer.covers(fix.time_s):
            return
        drift_m, quality = self._drift_m, self.mapper.quality()
        is_elsewhere = bool(quality.lost) and not quality.has_drifted  # its pose shows nothing about the map
        map_from_odom = None if is_elsewhere else self.map_from_odom
        if prior is not None:
            self._gps_check.add(prior, map_from_odom and map_from_odom @ self._pose_buffer.at(fix.time_s))
        self.earth.add(fix, self._pose_buffer.at(fix.time_s), map_from_odom, drift_m=drift_m)
        by_gps = self.earth.map_from_odom(better_than_m=drift_m)
        if by_gps is not None:
            self._corrected_from_odom = self.mapper.map_from_odom.inverse() @ by_gps
            self._slip_detector.reset()  # the pose moves, and not by the wheels
            self._mapped_var_rad2 = self._heading_var_rad2() - self.earth.heading_var_rad2

    def add_frame(self, frame: CameraFrame) -> None:
        """Add a camera frame; the tags in it are surveyed, or correct the pose."""
        self._frame = frame

    def map_datum(self) -> MapDatum | None:
        """Return the place of the map on Earth; None if no GPS has found it."""
        return None if self.earth is None else self.earth.map_datum()

    def change_datum(self, datum: MapDatum | None) -> None:
        """Take the place on Earth of a map that was loaded now; None if it is unknown."""
        if self.earth is not None:
            self.earth.restart(datum)
            self._gps_check = GpsCheck()

    @property
    def map_from_odom(self) -> Pose2:
        """The correction of the odometry: by the mapper, and by GPS where no scan could be matched."""
        return self.mapper.map_from_odom @ self._corrected_from_odom

    def warnings(self) -> dict[str, str]:
        """Return the input defects so far: one line with its count per kind, keyed by the kind's name."""
        warnings = self.scan_checker.summary_by_kind()
        for kind, lines in (
            ("LEAP", self._jump_filter.summary_lines()),
            ("SLIP", self._slip_detector.summary_lines()),
        ):
            if lines:
                warnings[kind] = lines[0]
        if self.drive_train is not None:
            warnings |= self.drive_train.warnings()
        if self.mount_check.finding is not None:
            warnings["MOUNT"] = describe(self.mount_check.finding, self._base_from_laser)
        if isinstance(self._odometry, GyroEkf):
            warnings |= self._odometry.warnings()
        if self._gps_check.finding:
            warnings["GPS"] = self._gps_check.finding
        if self._last_doubt:
            warnings["MAP"] = self._last_doubt
        return warnings

    def add_scan(self, scan: Scan) -> None:
        """Queue a scan; it is mapped as soon as odometry covers its whole revolution."""
        if UNUSABLE.intersection(self.scan_checker.check(scan)):
            return
        scan = scan.as_recorded()
        if self._self_returns is not None:
            scan = self._self_returns.filter(scan)
        self._waiting.append(scan)
        # Limit by time as well as by count: a scan stamped far ahead must not delay those after it.
        while (
            abs(scan.time_s - self._waiting[0].time_s) > MAX_SCAN_WAIT_S
            or len(self._waiting) > MAX_WAITING_SCANS
        ):
            self._waiting.popleft()
            self.scan_checker.count(ScanDefect.WAITED)
        self._map_covered_scans()

    @property
    def odometry(self) -> OdometrySample | None:
        """The newest odometry; None before the first telemetry."""
        return self._newest

    def map_and_pose(self) -> tuple[OccupancyGrid, Pose2]:
        """Return the map and the robot's pose in it, once there is a state."""
        state = self.state()
        assert state is not None
        return self.mapper.grid(), state.map_from_base

    def odom_from_base_at(self, time_s: float) -> Pose2 | None:
        """Return the odometry at a time within the last seconds; None if it does not cover it."""
        return self._pose_buffer.at(time_s) if self._pose_buffer.covers(time_s) else None

    def state(self) -> RobotState | None:
        """Return the state at the newest telemetry; None before the first."""
        if self._newest is None:
            return None
        scan_age_s = self._newest.time_s - self._scan_time_s
        frames = None
        if self._map_from_scan_base is not None:
            frames = ScanFrames(self._map_from_scan_base, self.map_from_odom)
        return RobotState(
            time_s=self._newest.time_s,
            map_from_base=self.map_from_odom @ self._newest.odom_from_base,
            twist=self._newest.twist,
            hits_in_map_m=self._hits_in_map_m,
            scan_age_s=scan_age_s if scan_age_s > -MAX_SCAN_WAIT_S else np.inf,  # a clock was set back
            lost=self._lost() if self.scans_mapped else "",
            frames=frames,
        )

    @property
    def _drift_m(self) -> float:
        """Error of the position by odometry since scans fixed it last [m]."""
        quality = self.mapper.quality()
        unmatched_m = UNMATCHED_DRIFT * (self.driven_m - self._matched_at_m)
        return max(unmatched_m, quality.std_m) if quality.has_drifted else unmatched_m

    def _lost(self) -> str:
        """Return why the pose is not trusted; a position that no wall fixes may be fixed by GPS."""
        quality = self.mapper.quality()
        if quality.has_drifted and self.earth is not None:
            is_fixed = self.earth.map_from_odom(better_than_m=self._drift_m) is not None
            return "" if is_fixed else quality.lost
        return quality.lost

    def _look_at_frame(self) -> None:
        frame, newest = self._frame, self._newest
        if frame is None or newest is None or self.tags is None or not self.scans_mapped:
            return
        odom_at_frame = self.odom_from_base_at(frame.time_s)
        if odom_at_frame is not None:
            self._frame = None
            self.tags.add(frame, odom_at_frame, newest.odom_from_base, self.map_from_odom, self.mapper)

    def _map_covered_scans(self) -> None:
        while self._waiting and self._newest is not None:
            scan = self._waiting[0]
            revolution_s = scan.time_increment_s * (scan.ranges_m.size - 1)
            if scan.time_s + revolution_s > self._newest.time_s:
                return
            self._waiting.popleft()
            if self._pose_buffer.covers(scan.time_s):
                self._map(self._floor_echoes.filter(scan), revolution_s)
            else:  # taken before the first telemetry
                self.scan_checker.count(ScanDefect.NO_ODOMETRY)

    def _heading_var_rad2(self) -> float:
        assert self._newest is not None  # a scan is mapped once the odometry covers it
        return float(self._newest.covariance[2, 2])

    def _turn_std_rad(self) -> float:
        """Return the error of the turn since the newest scan in the map [rad]; infinite without a gyroscope.

        The error of a heading by GPS counts as one of the odometry.
        """
        if not isinstance(self._odometry, GyroEkf):
            return math.inf
        # A correction of the past turns lowers the variance, and moves the heading by as much.
        return math.sqrt(abs(self._heading_var_rad2() - self._mapped_var_rad2))

    def _map(self, scan: Scan, revolution_s: float) -> None:
        odom_from_base = self._pose_buffer.at(scan.time_s)
        motion = odom_from_base.inverse() @ self._pose_buffer.at(scan.time_s + revolution_s)
        twist = Twist2()
        if revolution_s > 0.0:
            twist = Twist2(v_m_s=motion.x_m / revolution_s, w_rad_s=motion.theta_rad / revolution_s)
        corrected = self._corrected_from_odom @ odom_from_base
        update = self.mapper.update(corrected, scan, twist, turn_std_rad=self._turn_std_rad())
        if update.match_score >= GOOD_MATCH:  # not NaN, as of a scan that hits nothing
            self._matched_at_m = self.driven_m
        if update.match_score >= GOOD_MATCH or update.integrated:  # what the next scan is matched to
            self._mapped_var_rad2 = self._heading_var_rad2()
        self.mount_check.update(odom_from_base, scan)
        if update.jumped or update.match_score < GOOD_MATCH:
            self._slip_detector.reset()
        elif update.match_score >= GOOD_MATCH:
            self._slip_detector.update(odom_from_base, update.map_from_base)
        if isinstance(self.mapper, ReportsDoubt):
            self.map_doubt = self.mapper.map_doubt
            self._last_doubt = self.map_doubt or self._last_doubt
        self.scans_mapped += 1
        self._scan_time_s = scan.time_s + revolution_s
        points = scan_points(scan, twist, self._base_from_laser, scan.range_max_m)
        self._map_from_scan_base = self.map_from_odom @ odom_from_base
        self._hits_in_map_m = self._map_from_scan_base.apply(points.hits_m)
