"""What the robot takes in: one beat of the board's telemetry, the scans beside it, and what they mean."""

import math
from collections.abc import Callable
from dataclasses import fields, replace

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Telemetry
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.lidar.driver import LidarDriver
from thumper.lidar.scan import Scan
from thumper.navigation.state import Transition
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.state_estimator import RobotState, StateEstimator

TELEMETRY_TIMEOUT_S = 0.5
LATE_CYCLE_S = 0.15  # telemetry frames were lost on the way: the board must not miss commands for it
LATE_CYCLES = 2
CATCH_UP_CYCLES = 10  # a lidar that nobody read is ordered anew; a dead one is the drive_manager's affair
BLIND_S = 0.35  # without a new scan for this long (three turns) the robot must not move on
LIDAR_GONE_ERRORS = 5  # of its port one after another, without a scan between: the port itself has gone
LIDAR_RETRY_S = 5.0
MIN_SCANS = 3
FIRST_SCANS_TIMEOUT_S = 5.0
NO_TELEMETRY = "the board went silent before the start; is the cable loose?"


class SensorInputs:
    """Both ports behind one call a beat; `samples` and `scans` hold what the newest beat brought."""

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
        self.keep_log = True  # a robot that is on for days must not fill its memory
        self._heard_s = math.inf  # when telemetry was taken in last; before the first nothing is out of date
        self._offset_counts = (0, 0)  # to the board's counts, which begin anew when it restarts
        self._is_new_board = False
        self._open_lidar = open_lidar
        self._port_errors = 0  # of the lidar when its newest scan came
        self._open_again_s = 0.0

    def read(self, resend_command: Callable[[], None] | None = None) -> bool:
        """Take in one beat of both ports; False when the board is silent.

        While a beat is late, `resend_command` is given again, so that lost frames are not a lost link.
        """
        silence_s = TELEMETRY_TIMEOUT_S - LATE_CYCLES * LATE_CYCLE_S
        samples = self.board.poll(LATE_CYCLE_S)
        for wait_s in (*(LATE_CYCLES - 1) * (LATE_CYCLE_S,), silence_s):
            if samples:
                break
            if resend_command is not None:
                resend_command()
            samples = self.board.poll(wait_s)
        self.add_telemetry(samples)
        self.read_scans()
        return bool(samples)

    def read_scans(self) -> None:
        """Take in what the lidar has sent, without waiting."""
        self.scans = self.lidar.poll()
        if self.scans:
            self._port_errors = self.lidar.counters.port_errors
        for scan in self.scans:
            self.newest_scan = scan
            self.estimator.add_scan(scan)

    def add_telemetry(self, samples: list[TelemetrySample]) -> None:
        """Believe telemetry."""
        self.samples = [self._with_offset(sample) for sample in samples]
        if samples:
            self._heard_s = self.board.now_s()
        for sample in self.samples:
            self.telemetry = sample.telemetry
            self.estimator.add_telemetry(sample)
            if self.keep_log:
                self.log.add_speeds(sample)

    def replace_board(self, board: Board) -> None:
        """Go on with a board that was reached anew; should it have restarted, its counts are carried on."""
        self.board, self._is_new_board = board, True

    def reopen_lidar(self) -> bool:
        """Open the lidar anew once its port has gone; returns whether it answers again.

        It may wait for seconds: only for a robot that stands.
        """
        gone = self.lidar.counters.port_errors - self._port_errors >= LIDAR_GONE_ERRORS
        now_s = self.board.now_s()
        if not gone or self._open_lidar is None or now_s < self._open_again_s:
            return False
        self._open_again_s = now_s + LIDAR_RETRY_S
        self.lidar.close()  # else its name stays taken
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
        """Keep a change of navigation's state for the log."""
        if self.keep_log:
            self.log.transitions.append(transition)

    def _with_offset(self, sample: TelemetrySample) -> TelemetrySample:
        telemetry, last = sample.telemetry, self.telemetry
        if self._is_new_board and last is not None and telemetry.time_us < last.time_us:
            self._offset_counts = (
                last.left_count - telemetry.left_count,
                last.right_count - telemetry.right_count,
            )
        self._is_new_board = False
        if self._offset_counts == (0, 0):
            return sample
        left, right = self._offset_counts
        moved = replace(
            telemetry,
            left_count=_int32(telemetry.left_count + left),
            right_count=_int32(telemetry.right_count + right),
        )
        return replace(sample, telemetry=moved)

    def catch_up(self, step: Callable[[], bool]) -> None:
        """After a pause let `beat` pass until what has waited in the ports is taken in and a scan is new.

        What was heard long ago tells neither the board's state nor the place now.

        Raises
        ------
        ThumperError
            The board is silent.
        """
        if self.board.now_s() - self._heard_s <= LATE_CYCLE_S:
            return
        for _ in range(CATCH_UP_CYCLES):
            if not step():
                raise ThumperError(NO_TELEMETRY, exit_code=EXIT_NOT_THERE)
            state = self.estimator.state()
            sees = state is not None and (state.scan_age_s <= BLIND_S or not self.has_map)
            if sees and len(self.samples) <= LATE_CYCLES:  # as they are sent: nothing has waited
                return

    @property
    def has_map(self) -> bool:
        """Whether enough was seen to plan with."""
        return self.estimator.scans_mapped >= MIN_SCANS

    def wait_for_map(self, step: Callable[[], bool]) -> RobotState:
        """Stand still and let `beat` pass until the first scans are mapped: a plan needs a map.

        Raises
        ------
        ThumperError
            The board is silent, or the lidar is.
        """
        self.catch_up(step)
        waited_s = 0.0
        while not self.has_map:
            if waited_s > FIRST_SCANS_TIMEOUT_S:
                raise ThumperError(
                    "the lidar sends no scans in the board's time; is it powered, and the same robot's? "
                    "`thumper doctor --lidar PORT` tells more"
                )
            before = self.estimator.state()
            if not step():
                raise ThumperError(NO_TELEMETRY, exit_code=EXIT_NOT_THERE)
            now = self.estimator.state()
            if before and now:
                waited_s += now.time_s - before.time_s
        state = self.estimator.state()
        assert state is not None  # a scan is only mapped once odometry covers it
        return state


def _int32(value: int) -> int:
    return (value + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000
