"""Experiments that drive the board for a while inside the robot's process.

Packages provide them by the entry point `thumper.experiments`: a function that takes an
`ExperimentContext`.
"""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Command, State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper.ros.services import ExperimentReport, ExperimentState, StartExperiment
from thumper.runtime.drive.heartbeats import TIMEOUT_S, HeartbeatMonitor
from thumper.runtime.publisher import Publisher
from thumper.runtime.sensor_inputs import SensorInputs

FOLDER = Path("out") / "experiments"
MIN_LANE_M, MAX_LANE_M = 0.6, 10.0
MAX_LINES = 200
POLL_TIMEOUT_S = 0.5
DELIVERY_S = 0.02  # for the threads of the bus to queue what has arrived

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentContext:
    """What an experiment works with. Use all but `run_in_thread` only in the thread that called it."""

    board: Board
    folder: Path  # for logs and the report
    lane_m: float  # free floor ahead of the robot, and the same behind it
    report_progress: Callable[[int, int, str], None]  # done, total, what
    report_line: Callable[[str], None]  # a line of the result
    report_result: Callable[[str], None]  # the last line: what it brought, in one sentence
    run_in_thread: Callable[[Callable[[], Any]], Any]  # compute while the robot's loop continues


Experiment = Callable[[ExperimentContext], Path | None]
"""Drives and returns its report, an HTML page; raises ThumperError. It leaves the motors off."""


class BoardLender(Protocol):
    """The robot's control cycle, as far as it lends its board to an experiment."""

    @property
    def inputs(self) -> SensorInputs:
        """Board, lidar and state estimator."""
        ...

    @property
    def publisher(self) -> Publisher:
        """For events."""
        ...

    def step_lent(self, samples: list[TelemetrySample]) -> None:
        """Run one control cycle with telemetry that the experiment has read."""
        ...

    def process_requests(self) -> None:
        """Handle the requests that have arrived."""
        ...

    def stop(self, reason: str) -> object:
        """Stop and disarm; the status then shows `reason`."""
        ...


class LentBoard(Board):
    """A board whose `poll` also runs `on_poll`: the robot's loop continues while an experiment drives."""

    def __init__(self, board: Board, on_poll: Callable[[list[TelemetrySample]], None]) -> None:
        # No second handshake: the lent board answers through the one that is already open.
        self._board = board
        self._on_poll = on_poll
        self._identity = board.identity
        self.restarted = board.restarted

    def poll(self, timeout_s: float) -> list[TelemetrySample]:
        """Poll the board and run the loop; raise ThumperError if the experiment has to stop."""
        samples = self._board.poll(timeout_s)
        self.restarted = self._board.restarted
        self._on_poll(samples)
        return samples

    @property
    def receive_errors(self) -> int:
        """As of the board."""
        return self._board.receive_errors

    @property
    def port(self) -> Any:
        """The board's port."""
        return self._board.port

    def now_s(self) -> float:
        """Return the board's clock [s]."""
        return self._board.now_s()

    def set_wheel_speeds(self, speeds: WheelSpeeds) -> None:
        """Send speeds to the board."""
        self._board.set_wheel_speeds(speeds)

    def set_motor_pwm(self, left: int, right: int) -> None:
        """Send PWM to the board."""
        self._board.set_motor_pwm(left, right)

    def command(self, command: Command) -> None:
        """Send a command to the board."""
        self._board.command(command)

    def emergency_stop(self) -> None:
        """Stop the motors and latch it."""
        self._board.emergency_stop()

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter of the board."""
        self._board.set_parameter(name, value)

    def get_parameter(self, name: str) -> float:
        """Return a parameter of the board."""
        return self._board.get_parameter(name)

    def round_trip_s(self, question: int, timeout_s: float) -> float | None:
        """Return how long the board takes to answer."""
        return self._board.round_trip_s(question, timeout_s)

    def close(self) -> bool:
        """Do nothing and confirm nothing: the loop still needs the board."""
        return False


class Experiments:
    """At most one is requested or runs; the output of the newest is kept."""

    def __init__(self) -> None:
        self.heartbeats = HeartbeatMonitor()  # of the clients: an experiment may end beside an obstacle
        self.running = ""
        self.source = ""  # who requested it
        self.requested = ""  # but not started yet
        self._stop_reason = ""
        self._lane_m = 0.0
        self._progress: tuple[int, int, str] = (0, 0, "")
        self._lines: list[str] = []
        self._problem = ""
        self._result = ""
        self._report: Path | None = None

    def request(self, request: StartExperiment, source: str) -> str:
        """Request an experiment for the next cycle; raise ThumperError if it cannot run."""
        name, lane_m = request.name, request.lane_m
        names = [point.name for point in entry_points(group="thumper.experiments")]
        if self.running or self.requested:
            raise ThumperError(f"{self.running or self.requested} is running: cancel it first")
        if name not in names:
            raise ThumperError(f"unknown experiment {name!r}; choose from: {', '.join(sorted(names))}")
        if not MIN_LANE_M <= lane_m <= MAX_LANE_M:
            raise ThumperError(f"choose a lane of {MIN_LANE_M:g}...{MAX_LANE_M:g} m")
        self.requested, self.source, self._lane_m = name, source, lane_m
        return f"{name} begins"

    def stop(self, reason: str) -> bool:
        """Stop it in the next cycle; return whether one was running."""
        self.requested = ""
        if self.running:
            self._stop_reason = reason
        return bool(self.running)

    def drop(self, reason: str) -> None:
        """Forget an experiment that has not started: the robot failed, and later nobody expects it."""
        if self.requested:
            self.requested, self._problem = "", reason

    def state(self) -> ExperimentState:
        """Return what the dashboard shows of it."""
        done, total, what = self._progress
        return ExperimentState(
            running=self.running or self.requested,
            share=done / total if total else 0.0,
            what=what if self.running or self._problem else self._result,
            lines=list(self._lines),
            problem=self._problem,
            has_report=self._report is not None,
        )

    def report(self) -> ExperimentReport:
        """Return the newest report, an HTML page."""
        if self._report is None:
            raise ThumperError("there is no report yet; run an experiment first")
        return ExperimentReport(html=self._report.read_text(encoding="utf-8"))

    def run(self, loop: BoardLender) -> None:
        """Run the requested experiment on the board of `loop`, then stop. Only Ctrl-C is raised."""
        name = self.requested
        loop.publisher.publish_event(f"{name} begins")

        def on_poll(samples: list[TelemetrySample]) -> None:
            asked_s = time.monotonic()  # a heartbeat that arrives during a slow cycle waits for the next one
            loop.step_lent(samples)
            telemetry = loop.inputs.telemetry
            armed = telemetry is not None and telemetry.state is not State.DISARMED
            if armed and self._is_page_lost(loop, asked_s):
                self.stop(
                    "the experiment stopped: "
                    "the page or program that started it was closed, hidden or disconnected, "
                    f"or did not answer for {TIMEOUT_S:g} s; is this computer busy? Try again"
                )
            if self._stop_reason:
                raise ThumperError(self._stop_reason)

        loop.publisher.experiment = name
        try:
            ending = self._run_on(LentBoard(loop.inputs.board, on_poll))
        finally:
            loop.publisher.experiment = ""
        loop.stop(ending)
        loop.publisher.publish_event(f"{name}: {ending}")

    def _is_page_lost(self, loop: BoardLender, asked_s: float) -> bool:
        """Return whether the page was silent for too long at `asked_s`.

        A slow cycle also holds up the threads of the bus: what arrived meanwhile is not queued yet.
        """
        if not self.heartbeats.is_lost(self.source, asked_s):
            return False
        time.sleep(DELIVERY_S)
        loop.process_requests()
        return self.heartbeats.is_lost(self.source, asked_s)

    def _run_on(self, board: Board) -> str:
        """Run the experiment; return how it ended."""
        name, self.requested = self.requested, ""
        self.running, self._stop_reason, self._problem, self._report = name, "", "", None
        self._result = ""
        self._lines.clear()
        self._progress = (0, 0, "starting")
        try:
            context = self._context(board)
            # Loading takes seconds, the first time.
            experiment: Experiment = context.run_in_thread(lambda: _load(name))
            self._report = experiment(context)
        except ThumperError as error:
            self._problem = str(error)
        except Exception as error:  # an experiment must not end the robot's process
            self._problem = f"internal error: {type(error).__name__}: {error}"
        finally:
            self.running = ""
        return self._problem or self._result or "done"

    def _context(self, board: Board) -> ExperimentContext:
        FOLDER.mkdir(parents=True, exist_ok=True)

        def report_progress(done: int, total: int, what: str) -> None:
            self._progress = (done, total, what)

        def report_line(line: str) -> None:
            if len(self._lines) < MAX_LINES:
                self._lines.append(line)

        def report_result(text: str) -> None:
            report_line(text)
            self._result = text

        def run_in_thread(work: Callable[[], T]) -> T:
            pool = ThreadPoolExecutor(1)
            try:
                result = pool.submit(work)
                while not result.done():
                    board.poll(POLL_TIMEOUT_S)
                return result.result()
            finally:
                pool.shutdown(wait=False)  # who stops the experiment must not wait for its computation

        return ExperimentContext(
            board=board,
            folder=FOLDER,
            lane_m=self._lane_m,
            report_progress=report_progress,
            report_line=report_line,
            report_result=report_result,
            run_in_thread=run_in_thread,
        )


def _load(name: str) -> Experiment:
    (point,) = entry_points(group="thumper.experiments", name=name)
    return cast("Experiment", point.load())
