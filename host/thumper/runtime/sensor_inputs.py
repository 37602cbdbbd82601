"""Reads board and lidar once per control cycle and passes everything on to the state estimator."""

import math
from collections.abc import Callable
from dataclasses import fields, replace

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Telemetry
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.lidar.driver import LidarDriver
from thumper.lidar.scan import Scan
from thumper.navigation.state import Transition
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.state_estimator import StateEstimator

TELEMETRY_TIMEOUT_S = 0.5
LATE_CYCLE_S = 0.15  # telemetry was lost in transit: the board must not miss commands because of it
LATE_CYCLES = 2
BLIND_S = 0.35  # without a new scan for this long (three revolutions), the robot must stop
LIDAR_GONE_ERRORS = 5  # port errors in succession, without a scan between them: the port has gone
LIDAR_RETRY_S = 1.0  # opening a lidar that answers takes up to 3 s
MIN_SCANS = 3  # mapped before the first drive


class SensorInputs:
    """Board and lidar behind one call per cycle; `samples` and `scans` hold the data of the newest cycle."""

    def __init__(
        self,
        *,
        board: Board,
        lidar: LidarDriver,
        estimator: StateEstimator,
        open_lidar: Callable[[], LidarDriver] | None = None,
    ) -> None:
        self.board = board
        self.lidar = lidar
        self.estimator = estimator
        self.telemetry: Telemetry | None = None
        self.samples: list[TelemetrySample] = []
        self.scans: list[Scan] = []
        self.newest_scan: Scan | None = None
        self.log = DriveLog()
        self.keep_log = True  # off for a robot that runs for days, whose memory would fill up
        self._telemetry_read_s = math.inf  # before the first telemetry nothing is outdated
        self._count_offsets = (0, 0)  # added to the board's counts, which restart at zero with the board
        self._is_new_board = False
        self._open_lidar = open_lidar
        self._port_errors = 0  # the lidar's count at its newest scan
        self._next_open_s = 0.0

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
        return bool(samples)

    def read_scans(self) -> None:
        """Read what the lidar has sent, without waiting."""
        self.scans = self.lidar.poll()
        if self.scans:
            self._port_errors = self.lidar.counters.port_errors
        for scan in self.scans:
            self.newest_scan = scan
            self.estimator.add_scan(scan)

    def add_telemetry(self, samples: list[TelemetrySample]) -> None:
        """Add telemetry that was read from the board."""
        self.samples = [self._with_count_offsets(sample) for sample in samples]
        if samples:
            self._telemetry_read_s = self.board.now_s()
        for sample in self.samples:
            self.telemetry = sample.telemetry
            self.estimator.add_telemetry(sample)
            if self.keep_log:
                self.log.add_speeds(sample)

    def replace_board(self, board: Board) -> None:
        """Continue with a reconnected board; if it has restarted, its counts continue from the old ones."""
        self.board, self._is_new_board = board, True

    def reopen_lidar(self) -> bool:
        """Open the lidar again if its port has gone; return whether it answers again.

        May block for seconds: call it only while the robot is stationary.
        """
        gone = self.lidar.counters.port_errors - self._port_errors >= LIDAR_GONE_ERRORS
        now_s = self.board.now_s()
        if not gone or self._open_lidar is None or now_s < self._next_open_s:
            return False
        self._next_open_s = now_s + LIDAR_RETRY_S
        self.lidar.close()  # or its device name stays in use
        try:
            lidar = self._open_lidar()
        except ThumperError:
            return False
        for counter in fields(lidar.counters):  # they count from the start of the run
            before: int = getattr(self.lidar.counters, counter.name)
            setattr(lidar.counters, counter.name, before + getattr(lidar.counters, counter.name))
        lidar.counters.restarts += 1
        self.lidar, self._port_errors = lidar, lidar.counters.port_errors
        return True

    def log_transition(self, transition: Transition) -> None:
        """Add a transition of the navigator's state to the log."""
        if self.keep_log:
            self.log.transitions.append(transition)

    def log_progress(self, plan_m: FloatArray) -> None:
        """Add the present pose and the navigator's plan to the log."""
        state = self.estimator.state()
        if self.keep_log and state is not None:
            self.log.add_pose(state.time_s, state.map_from_base)
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


def _int32(value: int) -> int:
    return (value + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000
