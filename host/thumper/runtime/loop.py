"""The control loop of the robot: board and lidar in, state estimation and navigation, wheel speeds out.

The loop is single-threaded: the same bytes give the same run, and if the computer stalls, the board's own
300 ms time-out stops the motors. Telemetry paces the loop; the lidar is read without waiting. Requests wait
in a queue until the next cycle handles them. Messages go to sinks, which must not block.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol

from thumper.board.board import Board, TelemetrySample
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.signals import raise_lost_interrupt
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput
from thumper.ros.to_ros import ERROR
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode, DriveOutcome
from thumper.runtime.drive.goal_limits import GoalLimits
from thumper.runtime.drive.tasks import Leg, Task, carry_out, drive_to_goal
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.publisher import LoopTiming, Publisher
from thumper.runtime.real_time_rate import RealTimeRate
from thumper.runtime.requests import EmergencyStop
from thumper.runtime.safe_stop import stop_and_disarm
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.request_handler import RequestHandler
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.state_estimator import RobotState
from thumper.slam.mapper import Mapper

FIRST_SCANS_TIMEOUT_S = 5.0
CATCH_UP_CYCLES = 10  # a lidar that was not read must be restarted; a dead one ends the drive later
RECONNECT_PERIOD_S = 0.5
MAX_SILENT_CYCLES = 3  # of half a second each
NO_TELEMETRY = "the board went silent before the start; check its cable"
SILENT = "the board went silent; its firmware stops the motors"
RESTARTED = "the board has restarted; check its supply and cable"
UNCONFIRMED = "the board did not confirm the stop; it stops by itself after 300 ms without commands"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotParts:
    """The parts that the loop runs; `assembly.open_robot` wires them."""

    inputs: SensorInputs
    drive_manager: DriveManager
    goal_limits: GoalLimits
    request_queue: RequestQueue
    request_handler: RequestHandler
    publisher: Publisher
    open_board: Callable[[], Board]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """What a control cycle brought."""

    alive: bool  # the board sent telemetry
    output: NavigationOutput | None  # None if the navigator did not run


class Display(Protocol):
    """Shows the progress of a task."""

    def started(self, leg: Leg) -> None:
        """A leg starts."""
        ...

    def progress(self, progress: DriveProgress) -> None:
        """The navigator has run; called once per cycle."""
        ...

    def ended(self, result: DriveResult | None) -> None:
        """The leg has ended; None if it was refused before anything moved."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class NoDisplay:
    """Calls `on_progress`, if there is one, and shows nothing."""

    on_progress: Callable[[DriveProgress], None] = lambda _progress: None

    def started(self, leg: Leg) -> None:
        """Do nothing."""

    def progress(self, progress: DriveProgress) -> None:
        """Pass on the progress."""
        self.on_progress(progress)

    def ended(self, result: DriveResult | None) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Start:
    """Where and when a leg started."""

    time_s: float
    driven_m: float
    map_from_base: Pose2


class RobotLoop:
    """Runs tasks and control cycles. Whatever ends a drive, the motors are stopped on the way out."""

    def __init__(self, parts: RobotParts) -> None:
        self.inputs = parts.inputs
        self.publisher = parts.publisher
        self.drive_manager = parts.drive_manager
        self.request_queue = parts.request_queue
        self.request_handler = parts.request_handler
        self._goal_limits = parts.goal_limits
        self._open_board = parts.open_board
        self._rate = RealTimeRate(self.inputs.now_s, simulated=parts.inputs.board.port.has_simulated_clock)
        self._silent_cycles = 0
        self._timing = LoopTiming()

    @property
    def mapper(self) -> Mapper:
        """The mapper, with the map and the robot's pose in it."""
        return self.inputs.estimator.mapper

    @property
    def log(self) -> DriveLog:
        """The log of all drives so far, for plots and tables."""
        return self.inputs.log

    def run(self, task: Task, display: Display | None = None) -> DriveResult:
        """Carry out a task, leg by leg, and return its result. Ctrl-C ends the leg, not the process.

        Raises
        ------
        ThumperError
            A leg was refused before anything moved, and the task does not handle it.
        """
        return carry_out(task, lambda leg: self._drive(leg, display or NoDisplay()))

    def drive_to(
        self, goal: Goal, on_progress: Callable[[DriveProgress], None], *, clear_fault: bool = False
    ) -> DriveResult:
        """Drive to one goal, stop and disarm.

        A latched fault is cleared only on request. A lost-link fault is always cleared: the link works again.

        Raises
        ------
        ThumperError
            Before anything moves: no telemetry, no scan, a latched fault, or an impossible goal.
        """
        return self.run(drive_to_goal(goal, clear_fault=clear_fault), NoDisplay(on_progress=on_progress))

    @raise_lost_interrupt()
    def step(self) -> StepResult:
        """Run one control cycle: sense, handle requests, decide and act, publish."""
        alive = self.inputs.read(self.drive_manager.resend_command)
        started_s, late_s = time.perf_counter(), self._late_s()
        self.request_handler.process_pending()
        output = self._decide_and_act() if alive else None
        self._publish(output)
        if alive:
            self.request_handler.board_jobs.run_for(self.inputs.now_s)
        self._timing = LoopTiming(late_s=late_s, busy_s=time.perf_counter() - started_s)
        return StepResult(alive=alive, output=output)

    @raise_lost_interrupt()
    def step_lent(self, samples: list[TelemetrySample]) -> None:
        """Run one control cycle while an experiment drives the board: all but decide and act."""
        self.inputs.add_telemetry(samples)
        self.inputs.read_scans()
        self.request_handler.process_pending()
        self._publish()
        if samples:
            self.request_handler.board_jobs.run_for(self.inputs.now_s)
        self._rate.wait()

    def serve_step(self) -> None:
        """Run one control cycle of `serve_requests`. After a failure, stop and continue to serve."""
        self._guarded_step(None, lambda _step: None)

    def catch_up(self) -> None:
        """After a pause of the caller, run cycles until the ports are drained and a new scan is in.

        Old telemetry and scans show neither the board's present state nor the present pose.

        Raises
        ------
        ThumperError
            The board is silent.
        """
        if not self.inputs.is_outdated:
            return
        for _ in range(CATCH_UP_CYCLES):
            self._step_or_raise()
            if self.inputs.is_current:
                return

    def wait_for_map(self) -> RobotState:
        """Run cycles without moving until the first scans are mapped: a plan needs a map.

        Raises
        ------
        ThumperError
            The board or the lidar is silent.
        """
        estimator = self.inputs.estimator
        self.catch_up()
        waited_s = 0.0
        while not self.inputs.has_map:
            if waited_s > FIRST_SCANS_TIMEOUT_S:
                raise ThumperError(
                    "the lidar sends no scans that match the board's clock; is it powered, and on the same "
                    "robot? `thumper doctor --lidar PORT` shows more"
                )
            before = estimator.state()
            self._step_or_raise()
            now = estimator.state()
            if before and now:
                waited_s += now.time_s - before.time_s
        state = estimator.state()
        assert state is not None  # a scan is mapped only once odometry covers it
        return state

    def stop(self) -> bool:
        """Stop and disarm; return whether the board confirmed it.

        Every exit path ends here: it never raises, and depends on nothing but the board until that has
        stopped.
        """
        result = stop_and_disarm(self.inputs.board)
        with suppress(Exception):  # an error here must not hide how the drive ended
            self.inputs.add_telemetry(result.samples)
            self.inputs.scans = []
            self._publish()  # a recording contains the stop as well
        self.drive_manager.on_stopped()
        return result.confirmed

    def _drive(self, leg: Leg, display: Display) -> DriveResult:
        """Drive one leg, or serve requests until Ctrl-C."""
        serving = leg.goal is None
        handler = self.request_handler
        handler.accepts_goals, self.inputs.keep_log = serving, not serving
        self._rate.set_speed(leg.speed)
        handler.simulation.set_speed = self._rate.set_speed if serving else None
        result: DriveResult | None = None
        display.started(leg)
        try:
            start = self._start_or_stop(leg)
            outcome = self._run_until_outcome(leg.goal, start, display)
            result = self._result(start, outcome)
        finally:
            display.ended(result)
        return result

    def _start_or_stop(self, leg: Leg) -> _Start:
        """Start a leg; Ctrl-C meanwhile may come when the motors are armed already."""
        try:
            return self._start(leg)
        except KeyboardInterrupt:
            self.stop()
            raise

    def _start(self, leg: Leg) -> _Start:
        """Arm and start to drive; raise ThumperError, before anything moves, if that is impossible."""
        estimator = self.inputs.estimator
        if leg.goal is None:
            return _Start(time_s=self.inputs.now_s(), driven_m=estimator.driven_m, map_from_base=Pose2())
        state = self.wait_for_map()
        start = _Start(time_s=state.time_s, driven_m=estimator.driven_m, map_from_base=state.map_from_base)
        self._goal_limits.check(leg.goal)
        self.drive_manager.start(leg.goal, self.inputs.telemetry, clear_fault=leg.clear_fault)
        return start

    def _run_until_outcome(self, goal: Goal | None, start: _Start, display: Display) -> DriveOutcome:
        """Run control cycles until the leg has ended or Ctrl-C; on every way out, stop and disarm."""

        def show(step: StepResult) -> None:
            self._log_and_show(step, goal, start, display)

        outcome: DriveOutcome | None = None
        try:
            while outcome is None:
                outcome = self._guarded_step(goal, show)
                self._rate.wait()
        except KeyboardInterrupt:
            outcome = DriveOutcome(reached=False, reason="interrupted", by_user=True)
        finally:
            confirmed = self.stop()
        return outcome if confirmed else replace(outcome, reason=f"{outcome.reason}; {UNCONFIRMED}")

    def _guarded_step(self, goal: Goal | None, show: Callable[[StepResult], None]) -> DriveOutcome | None:
        """Run one control cycle and return how the drive ended, once it has.

        A failure ends a drive to a `goal` of the loop's own. Without one, the robot stops, reconnects if
        need be, and continues to serve.
        """
        try:
            step = self.step()
            if goal is None:
                self._serve(step)
                return None
            if self.inputs.board.restarted:
                return DriveOutcome(reached=False, reason=RESTARTED)
            if not step.alive:
                return DriveOutcome(reached=False, reason=SILENT)
            show(step)
            return self.drive_manager.outcome
        except ThumperError as error:
            reason, board_failed = str(error), True
        except Exception as error:  # in motion nothing may prevent the stop that follows
            reason, board_failed = f"internal error: {type(error).__name__}: {error}", False
        if goal is not None:
            return DriveOutcome(reached=False, reason=reason)
        if board_failed:
            self._reconnect(reason)
        else:
            self.drive_manager.abort(reason)
            self.stop()
            self.request_handler.advance_mission()
        return None

    def _serve(self, step: StepResult) -> None:
        """Between two cycles of a robot that serves requests: next leg, lost parts, experiments."""
        handler = self.request_handler
        self._silent_cycles = 0 if step.alive else self._silent_cycles + 1
        if self._silent_cycles:
            self.drive_manager.abort(SILENT)
        handler.advance_mission()
        if self.inputs.board.restarted:
            self._reconnect(RESTARTED)
        elif self._silent_cycles > MAX_SILENT_CYCLES:
            self._reconnect(SILENT)
        elif handler.experiments.requested and not handler.board_jobs:
            handler.experiments.run(self)
        elif self.drive_manager.mode is DriveMode.IDLE and self.inputs.reopen_lidar():
            self.publisher.publish_event("the lidar answers again", name="lidar")

    def _reconnect(self, reason: str) -> None:
        """Try until the board answers; meanwhile its own time-out keeps the motors off.

        The loop does not resume what it did before.
        """
        self.drive_manager.abort(reason)
        self.request_handler.advance_mission()
        self.publisher.publish_event(reason, ERROR, name="board")
        must_latch = False
        while True:
            self.inputs.samples, self.inputs.scans = [], self.inputs.lidar.poll()
            self._publish()
            must_latch |= self.request_handler.refuse(reason)
            self.inputs.board.close()
            try:
                board = self._open_board()
                break
            except ThumperError:
                time.sleep(RECONNECT_PERIOD_S)
        self.inputs.replace_board(board)
        self.drive_manager.board = board
        self.publisher.publish_event("the board answers again; the motors are off", name="board")
        self.drive_manager.reason = ""
        if must_latch:
            self.request_queue.put(EmergencyStop())

    def _step_or_raise(self) -> None:
        if not self.step().alive:
            raise ThumperError(NO_TELEMETRY, exit_code=EXIT_NOT_THERE)

    def _decide_and_act(self) -> NavigationOutput | None:
        state, telemetry = self.inputs.estimator.state(), self.inputs.telemetry
        if state is None or telemetry is None:
            return None
        return self.drive_manager.step(telemetry, state, self.mapper.grid)

    def _publish(self, output: NavigationOutput | None = None) -> None:
        self.publisher.publish(self.inputs, self.drive_manager, output, self._timing)

    def _log_and_show(self, step: StepResult, goal: Goal | None, start: _Start, display: Display) -> None:
        state = self.inputs.estimator.state()
        if step.output is None or state is None or goal is None:
            return
        self.log.add_pose(state.time_s, state.map_from_base)
        self.log.add_plan(step.output.plan)
        display.progress(
            DriveProgress(
                time_s=state.time_s - start.time_s,
                distance_to_goal_m=goal.distance_m(state.map_from_base),
                reason=step.output.reason,
            )
        )

    def _result(self, start: _Start, outcome: DriveOutcome) -> DriveResult:
        estimator = self.inputs.estimator
        state = estimator.state()
        return DriveResult(
            reached=outcome.reached,
            interrupted=outcome.by_user,
            reason=outcome.reason,
            time_s=state.time_s - start.time_s if state else 0.0,
            path_length_m=estimator.driven_m - start.driven_m,
            map_from_base=state.map_from_base if state else start.map_from_base,
            navigation_failed=outcome.navigation_failed,
        )

    def _late_s(self) -> float:
        """How much later than its telemetry a cycle starts."""
        state = self.inputs.estimator.state()
        return self.inputs.now_s() - state.time_s if state else 0.0
