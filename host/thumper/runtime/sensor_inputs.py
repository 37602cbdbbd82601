"""Reads all sensors once per control cycle and passes everything on to the state estimator."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Telemetry
from thumper.common.geometry import FloatArray
from thumper.common.sensor import ReopenedSensor
from thumper.common.serial_port import called_before_waits
from thumper.imu.options import MPU6050
from thumper.imu.sample import ImuSample
from thumper.lidar.scan import Scan
from thumper.navigation.state import Transition
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.sensor_table import GPS, SensorFeed
from thumper.runtime.state_estimator import StateEstimator

TELEMETRY_TIMEOUT_S = 0.5
LATE_CYCLE_S = 0.15  # telemetry was lost in transit: the board must not miss commands because of it
LATE_CYCLES = 2
BLIND_S = 0.35  # without a new scan for this long (three revolutions), the robot must stop
MIN_SCANS = 3  # mapped before the first drive


class SensorInputs:
    """Board and lidar behind one call per cycle; `samples` and `scans` hold the data of the newest cycle."""

    def __init__(
        self,
        *,
        board: Board,
        lidar: ReopenedSensor[Scan],
        feeds: tuple[SensorFeed, ...] = (),
        estimator: StateEstimator,
    ) -> None:
        self.board = board
        self.lidar = lidar
        self.feeds = feeds
        self.estimator = estimator
        self.telemetry: Telemetry | None = None
        self.samples: list[TelemetrySample] = []
        self.board_imu: list[ImuSample] = []  # of the board's gyroscope
        self.scans: list[Scan] = []
        self.newest_scan: Scan | None = None
        self.log = DriveLog()
        self.keep_log = True  # off for a robot that runs for days, whose memory would fill up
        self._telemetry_read_s = math.inf  # before the first telemetry nothing is outdated
        self._count_offsets = (0, 0)  # added to the board's counts, which restart at zero with the board
        self._is_new_board = False

    @property
    def sensors(self) -> tuple[ReopenedSensor[Any], ...]:
        """The sensors with a port of their own."""
        return (self.lidar, *(feed.sensor for feed in self.feeds))

    def now_s(self) -> float:
        """Return the robot's clock [s]: that of the present board, which changes with each reconnection."""
        return self.board.now_s()

    def read(self, resend_command: Callable[[], None] | None = None) -> bool:
        """Read one control cycle from board and lidar; return False if the board sent nothing.

        While telemetry is late, call `resend_command`, so that lost frames do not become a lost link.
        """
        last_wait_s = TELEMETRY_TIMEOUT_S - LATE_CYCLES * LATE_CYCLE_S
        samples = self.board.poll(LATE_CYCLE_S)
        for wait_s in (*(LATE_CYCLES - 1) * (LATE_CYCLE_S,), last_wait_s):
            if samples:
                break
            if resend_command is not None:
                resend_command()
            samples = self.board.poll(wait_s)
        self.add_telemetry(samples)
        self.read_scans()
        # Before the first scans are mapped, the pose is still that of the odometry.
        state = self.estimator.state() if self.keep_log and samples and self.has_map else None
        if state is not None:
            self.log.add_pose(state.time_s, state.map_from_base)
        return bool(samples)

    def read_scans(self) -> None:
        """Read what the lidar has sent, without waiting."""
        self.scans = self.lidar.poll()
        for scan in self.scans:
            self.newest_scan = scan
            self.estimator.add_scan(scan)

    def add_telemetry(self, samples: list[TelemetrySample]) -> None:
        """Add telemetry that was read from the board."""
        for feed in self.feeds:  # before the telemetry, which the samples up to now belong to
            feed.read(self.estimator)
        self.samples = [self._with_count_offsets(sample) for sample in samples]
        if samples:
            self._telemetry_read_s = self.board.now_s()
        self.board_imu = []
        for sample in self.samples:
            if self.estimator.uses_board_gyroscope:
                self.board_imu += _imu_samples(self.telemetry, sample)
            self.telemetry = sample.telemetry
            self.estimator.add_telemetry(sample)
            if self.keep_log:
                self.log.add_speeds(sample)

    def replace_board(self, board: Board) -> None:
        """Continue with a reconnected board; if it has restarted, its counts continue from the old ones."""
        self.board, self._is_new_board = board, True

    def reopen_sensors(self) -> list[str]:
        """Open sensors again whose port has gone; return the names of those that answer again.

        May block for seconds: call it only while the robot is stationary.
        """
        now_s = self.board.now_s()
        return [sensor.name for sensor in self.sensors if sensor.reopen(now_s)]

    def reopen_lidar(self, meanwhile: Callable[[], None]) -> bool:
        """Open only the lidar again, if its port has gone; return whether it answers again.

        Calls `meanwhile` at least every 0.1 s; it may raise ThumperError to put the attempt off.
        """
        with called_before_waits(meanwhile):
            return self.lidar.reopen(self.board.now_s())

    def log_transition(self, transition: Transition) -> None:
        """Add a transition of the navigator's state to the log."""
        if self.keep_log:
            self.log.transitions.append(transition)

    def log_plan(self, plan_m: FloatArray) -> None:
        """Add the navigator's plan to the log."""
        if self.keep_log:
            self.log.add_plan(plan_m)

    @property
    def is_outdated(self) -> bool:
        """Whether more than a cycle has passed since the last telemetry, because the caller paused."""
        return self.board.now_s() - self._telemetry_read_s > LATE_CYCLE_S

    @property
    def is_current(self) -> bool:
        """Whether the ports are drained and the newest scan is recent, if there was one before."""
        state = self.estimator.state()
        if state is None or (self.has_map and state.scan_age_s > BLIND_S):
            return False
        return len(self.samples) <= LATE_CYCLES  # arrives as it is sent: nothing has waited in the port

    @property
    def has_gps(self) -> bool:
        """Whether the robot has a GPS, with or without a fix."""
        return any(feed.kind is GPS for feed in self.feeds)

    @property
    def has_map(self) -> bool:
        """Whether enough scans have been mapped to plan a path."""
        return self.estimator.scans_mapped >= MIN_SCANS

    def _with_count_offsets(self, sample: TelemetrySample) -> TelemetrySample:
        telemetry, last = sample.telemetry, self.telemetry
        if self._is_new_board and last is not None and telemetry.time_us < last.time_us:
            self._count_offsets = (
                last.left_count - telemetry.left_count,
                last.right_count - telemetry.right_count,
            )
        self._is_new_board = False
        if self._count_offsets == (0, 0):
            return sample
        left, right = self._count_offsets
        shifted = replace(
            telemetry,
            left_count=_int32(telemetry.left_count + left),
            right_count=_int32(telemetry.right_count + right),
        )
        return replace(sample, telemetry=shifted)


def _imu_samples(last: Telemetry | None, sample: TelemetrySample) -> list[ImuSample]:
    """Return the mean rate of the board's gyroscope since the telemetry before; none without one."""
    turn_rad = sample.gyro_increment_rad
    if last is None or turn_rad is None or sample.telemetry.time_us == last.time_us:
        return []
    period_s = 1e-6 * ((sample.telemetry.time_us - last.time_us) % 2**32)
    rate_std_rad_s = MPU6050.mean_rate_std_rad_s(period_s)
    rate_rad_s = turn_rad / period_s
    return [ImuSample(time_s=sample.time_s, yaw_rate_rad_s=rate_rad_s, yaw_rate_std_rad_s=rate_std_rad_s)]


def _int32(value: int) -> int:
    return (value + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000
