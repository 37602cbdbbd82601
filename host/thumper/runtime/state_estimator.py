"""From wheel counts and scans to where the robot is and what stands round it. Pure: no I/O, no clock.

What comes in is first rounded to what a recording keeps of it, so that a replay gives the same bits.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from thumper.board.board import TelemetrySample
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.common.stamps import rounded_s
from thumper.lidar.deskew import scan_points
from thumper.lidar.scan import Scan
from thumper.lidar.scan_checks import ScanChecker, ScanDefect
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.imu import ImuOptions, ImuSample
from thumper.odometry.jump_filter import JumpFilter
from thumper.odometry.pose_buffer import PoseBuffer
from thumper.odometry.slip_detector import GOOD_MATCH, SlipDetector
from thumper.odometry.wheel_odometry import OdometrySample, WheelOdometry
from thumper.slam.mapper import Mapper, ReportsDoubt

MAX_SCAN_WAIT_S = 1.0  # of a scan for its odometry
MAX_WAITING_SCANS = 100  # whatever their stamps say
UNUSABLE = {ScanDefect.STAMP, ScanDefect.BEAMS}


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """What navigation decides on: newest pose and speed, and the newest scan's obstacles."""

    time_s: float
    map_from_base: Pose2
    twist: Twist2
    hits_in_map_m: FloatArray  # shape (n, 2)
    scan_age_s: float  # +inf before the first scan
    lost: str = ""  # why nobody should drive by this pose; empty while one may


class StateEstimator:
    """Odometry and mapping behind two inputs and one output."""

    def __init__(
        self,
        *,
        drive: DriveGeometry,
        base_from_laser: Pose2,
        mapper: Mapper,
        imu: ImuOptions | None = None,
    ) -> None:
        self.mapper = mapper
        self._base_from_laser = base_from_laser
        self._odometry: WheelOdometry | GyroEkf = WheelOdometry(drive)
        if imu is not None and imu.enabled:
            self._odometry = GyroEkf(drive, imu=imu)
        self._bridge = JumpFilter()
        self._slip = SlipDetector()
        self._history = PoseBuffer()
        self._newest: OdometrySample | None = None
        self._waiting: deque[Scan] = deque()
        self._hits_in_map_m = np.empty((0, 2))
        self._scan_time_s = -np.inf
        self.monitor = ScanChecker()
        self.scans_mapped = 0
        self.driven_m = 0.0  # by the wheels: in the map the pose also moves where the robot does not
        self.map_doubt = ""  # why the map localised in might be the wrong one, as was last said

    def add_telemetry(self, sample: TelemetrySample) -> None:
        """Advance the odometry."""
        telemetry = sample.telemetry
        time_s = rounded_s(sample.time_s)
        newest = self._odometry.update(time_s, telemetry.left_count, telemetry.right_count)
        leaps = self._bridge.jumps
        bridged = replace(newest, odom_from_base=self._bridge.filter(time_s, newest.odom_from_base))
        if self._newest is not None:
            self.driven_m += self._newest.odom_from_base.distance_m(bridged.odom_from_base)
        self._newest = bridged if self._bridge.jumps == leaps else replace(bridged, twist=Twist2())
        self._history.add(self._newest)
        self._map_what_is_covered()

    def add_imu(self, sample: ImuSample) -> None:
        """Take a reading of the gyroscope, before the telemetry that it precedes; ignored unless enabled."""
        if isinstance(self._odometry, GyroEkf):
            self._odometry.add_imu(sample)

    def notes(self) -> dict[str, str]:
        """What was wrong with the input so far: one line with its count for each kind, by the kind's name."""
        notes = self.monitor.summary_by_kind()
        for kind, lines in (("LEAP", self._bridge.summary_lines()), ("SLIP", self._slip.summary_lines())):
            if lines:
                notes[kind] = lines[0]
        if isinstance(self._odometry, GyroEkf) and self._odometry.slips:
            notes["TURN_SLIP"] = (
                f"{self._odometry.slips} times wheels and gyroscope disagreed: the wheels slip"
            )
        if self.map_doubt:
            notes["MAP"] = self.map_doubt
        return notes

    def add_scan(self, scan: Scan) -> None:
        """Queue a scan; it is mapped as soon as odometry covers its whole turn."""
        if UNUSABLE.intersection(self.monitor.check(scan)):
            return
        scan = scan.as_recorded()
        self._waiting.append(scan)
        # By time, not by count alone; a scan stamped far ahead must not hold up those that follow it.
        while (
            abs(scan.time_s - self._waiting[0].time_s) > MAX_SCAN_WAIT_S
            or len(self._waiting) > MAX_WAITING_SCANS
        ):
            self._waiting.popleft()
            self.monitor.count(ScanDefect.WAITED)
        self._map_what_is_covered()

    @property
    def odometry(self) -> OdometrySample | None:
        """Where the wheels alone say the robot is; None before the first telemetry."""
        return self._newest

    def state(self) -> RobotState | None:
        """Return the state at the newest telemetry; None before the first."""
        if self._newest is None:
            return None
        scan_age_s = self._newest.time_s - self._scan_time_s
        return RobotState(
            time_s=self._newest.time_s,
            map_from_base=self.mapper.map_from_odom @ self._newest.odom_from_base,
            twist=self._newest.twist,
            hits_in_map_m=self._hits_in_map_m,
            scan_age_s=scan_age_s if scan_age_s > -MAX_SCAN_WAIT_S else np.inf,  # a clock was set back
            lost=self.mapper.quality().lost if self.scans_mapped else "",
        )

    def _map_what_is_covered(self) -> None:
        while self._waiting and self._newest is not None:
            scan = self._waiting[0]
            turn_s = scan.time_increment_s * (scan.ranges_m.size - 1)
            if scan.time_s + turn_s > self._newest.time_s:
                return
            self._waiting.popleft()
            if not self._history.covers(scan.time_s):
                self.monitor.count(ScanDefect.NO_ODOMETRY)
                continue  # older than the odometry: taken before the board was heard
            odom_from_base = self._history.at(scan.time_s)
            turned = odom_from_base.inverse() @ self._history.at(scan.time_s + turn_s)
            twist = Twist2()
            if turn_s > 0.0:
                twist = Twist2(v_m_s=turned.x_m / turn_s, w_rad_s=turned.theta_rad / turn_s)
            update = self.mapper.update(odom_from_base, scan, twist)
            if update.jumped or update.match_score < GOOD_MATCH:
                self._slip.reset()
            elif update.match_score >= GOOD_MATCH:
                self._slip.update(odom_from_base, update.map_from_base)
            if isinstance(self.mapper, ReportsDoubt):
                self.map_doubt = self.mapper.map_doubt or self.map_doubt
            self.scans_mapped += 1
            self._scan_time_s = scan.time_s + turn_s
            points = scan_points(scan, twist, self._base_from_laser, scan.range_max_m)
            self._hits_in_map_m = (self.mapper.map_from_odom @ odom_from_base).apply(points.hits_m())
