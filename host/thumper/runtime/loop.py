"""The control loop of the robot: board and lidar in, state estimation and navigation, wheel speeds out.

The loop is single-threaded: the same bytes give the same run, and if the computer stalls, the board's own
300 ms time-out stops the motors. Telemetry paces the loop; the lidar is read without waiting. Requests wait
in a queue until the next cycle handles them. Messages go to sinks, which must not block.

A task decides what the robot does next: the program's own in `run`, those of clients in `serve`. Both run
the same cycles and end on the same way, `_loop`.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.signals import forget_interrupts
from thumper.maps.annotations import Annotations
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.runtime.control_cycle import ControlCycle, StepResult
from thumper.runtime.drive.display import Display, NoDisplay
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode, DriveOutcome
from thumper.runtime.drive.exploration import map_to_explore
from thumper.runtime.drive.leg_run import RESTARTED
from thumper.runtime.drive.running_task import RunningTask
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.drive.tasks import Task, wait
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.object_finder import ObjectFinder
from thumper.runtime.publisher import Publisher
from thumper.runtime.real_time_rate import RealTimeRate
from thumper.runtime.reconnection import Reconnection
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service import wheels
from thumper.runtime.service.request_handler import RequestHandler
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.state_estimator import RobotState
from thumper.slam.mapper import Mapper

MAX_SILENT_CYCLES = 3  # of half a second each
NO_TELEMETRY = "the board went silent before the start; check its cable"
SILENT = "the board went silent; its firmware stops the motors"
UNCONFIRMED = "the board did not confirm the stop; it stops by itself after 300 ms without commands"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotParts:
    """The parts that the loop runs; `assembly.open_robot` wires them."""

    inputs: SensorInputs
    drive_manager: DriveManager
    task_driver: TaskDriver
    request_queue: RequestQueue
    request_handler: RequestHandler
    publisher: Publisher
    reconnection: Reconnection
    object_finder: ObjectFinder | None = None
    before_save: Callable[[], None]  # called before the map is written to the folder of the run


@dataclass(frozen=True, slots=True, kw_only=True)
class _Failure:
    """Why a cycle failed."""

    error: ThumperError
    board_answers: bool = False
    reconnect: bool = False


class RobotLoop:
    """Runs tasks. Whatever ends a drive, the motors are stopped on the way out."""

    def __init__(self, parts: RobotParts) -> None:
        self.inputs = parts.inputs
        self.publisher = parts.publisher
        self.drive_manager = parts.drive_manager
        self.request_queue = parts.request_queue
        self.request_handler = parts.request_handler
        self._tasks = parts.task_driver
        self._reconnection = parts.reconnection
        self._rate = RealTimeRate(self.inputs.now_s, simulated=parts.inputs.board.port.has_simulated_clock)
        self.control_cycle = ControlCycle(
            inputs=self.inputs,
            request_handler=self.request_handler,
            drive_manager=self.drive_manager,
            publisher=self.publisher,
            rate=self._rate,
            object_finder=parts.object_finder,
        )
        self.before_save = parts.before_save
        self.after_cycle: list[Callable[[], None]] = []  # must neither block nor take long
        self._silent_cycles = 0

    @property
    def mapper(self) -> Mapper:
        """The mapper, with the map and the robot's pose in it."""
        return self.inputs.estimator.mapper

    def map_and_pose(self) -> tuple[OccupancyGrid, Pose2]:
        """Return the map, its keep-out zones occupied, and the robot's pose in it, once there is a state."""
        return map_to_explore(self.inputs.estimator, self.drive_manager.navigator)()

    @property
    def annotations(self) -> Annotations:
        """The zones and places of the map in use."""
        return self.request_handler.annotations.value

    @property
    def log(self) -> DriveLog:
        """The log of all drives so far, for plots and tables."""
        return self.inputs.log

    def run(self, task: Task, display: Display | None = None) -> DriveResult:
        """Carry out a task, leg by leg, and return its result.

        Ctrl-C ends the task, not the process. Before the first leg has started, KeyboardInterrupt is raised.

        Raises
        ------
        ThumperError
            A leg was refused before anything moved, and the task does not handle it.
        """
        with self._own_task(RunningTask(task), display or NoDisplay()) as running:
            self._loop(lambda: running.is_over)
            return running.result()

    def serve(self, *, speed: float = 1.0) -> bool:
        """Do what clients request until Ctrl-C, or until they choose another simulated world.

        Return whether the board confirmed the stop at the end.

        A simulated robot runs at `speed` times real time.
        """
        simulation = self.request_handler.simulation
        self.inputs.keep_log = False
        self._rate.set_speed(speed)
        simulation.rate = self._rate
        try:
            return self._loop(lambda: bool(simulation.next_world))
        finally:
            simulation.rate = None

    def wait_for_map(self) -> RobotState:
        """Move nothing until the first scans are mapped; after a pause of the caller, catch up first.

        Raises
        ------
        ThumperError
            The board or the lidar is silent.
        """
        if self.inputs.is_outdated or not self.inputs.has_map:
            self.run(wait())
        state = self.inputs.estimator.state()
        assert state is not None  # a scan is mapped only once odometry covers it
        return state

    def cycle(self) -> None:
        """Run one control cycle and do what follows from it. Raises nothing but KeyboardInterrupt."""
        failure: _Failure | None = None
        try:
            if self._reconnection.is_active:
                self._reconnect()
            elif self._tasks.start_leg():
                failure = self._run_cycle()
            elif not self._is_serving and self.drive_manager.mode is not DriveMode.IDLE:
                self.stop()  # the leg that should have followed without a stop was refused
            for call in self.after_cycle:
                call()
        except ThumperError as error:
            failure = _Failure(error=error, reconnect=True)
        except Exception as error:  # in motion nothing may prevent the stop that follows
            internal = ThumperError(f"internal error: {type(error).__name__}: {error}")
            failure = _Failure(error=internal, board_answers=True)
        if failure is not None:
            self._fail(failure)

    def step(self) -> StepResult:
        """Run one control cycle without what follows from it."""
        return self.control_cycle.step()

    def stop(self) -> bool:
        """Stop and disarm; return whether the board confirmed it. Never raises."""
        return self.control_cycle.stop().confirmed

    def _loop(self, is_over: Callable[[], bool]) -> bool:
        """Run control cycles until `is_over` or Ctrl-C, which stops the motors.

        Returns False if the board did not confirm that stop.
        """
        try:
            while not is_over():
                self.cycle()
                self._rate.wait()
        except KeyboardInterrupt:
            confirmed = self.stop()
            forget_interrupts()
            if not self._is_serving:
                self._tasks.interrupt(unconfirmed="" if confirmed else UNCONFIRMED)
            return confirmed
        except BaseException:
            self.stop()
            raise
        return True

    @contextmanager
    def _own_task(self, task: RunningTask, display: Display) -> Iterator[RunningTask]:
        """Make `task` that of the loop, which accepts none from clients meanwhile."""
        handler = self.request_handler
        before = (handler.accepts_goals, self.inputs.keep_log)
        handler.accepts_goals, self.inputs.keep_log = False, True
        self._rate.set_speed(math.inf)
        self._tasks.begin(task, display)
        try:
            yield task
        finally:
            handler.accepts_goals, self.inputs.keep_log = before
            self._tasks.clear()

    @property
    def _is_serving(self) -> bool:
        """Whether clients decide what the robot does."""
        return self.request_handler.accepts_goals

    def _run_cycle(self) -> _Failure | None:
        step = self.step()
        self._silent_cycles = 0 if step.alive else self._silent_cycles + 1
        if self.inputs.board.restarted:
            return _Failure(error=ThumperError(RESTARTED), reconnect=True)
        if not step.alive:
            return _Failure(error=ThumperError(SILENT), reconnect=self._silent_cycles > MAX_SILENT_CYCLES)
        if outcome := self._tasks.follow_up(step.output):
            self._end_leg(outcome)
        elif self.drive_manager.mode is DriveMode.IDLE:
            self._work_while_idle()
        elif self.drive_manager.holds_still and self.inputs.reopen_lidar(self._hold_still):
            self._publish_return("lidar")
        return None

    def _end_leg(self, outcome: DriveOutcome) -> None:
        """End a leg. A leg of the program's own leaves the motors off; a client's may continue without."""
        is_interrupted = False
        if not self._is_serving and self._tasks.leg_moves and not outcome.drives_on:
            stopped = self.control_cycle.stop()
            is_interrupted = stopped.interrupted
            if not stopped.confirmed:
                outcome = replace(outcome, reason=f"{outcome.reason}; {UNCONFIRMED}")
        self._tasks.end_leg(outcome)
        if is_interrupted:
            raise KeyboardInterrupt

    def _work_while_idle(self) -> None:
        handler = self.request_handler
        if handler.experiments.requested and not handler.board_jobs:
            handler.experiments.run(self.control_cycle)
            wheels.read_again(self.inputs.estimator, self.inputs.board)
            return
        for name in self.inputs.reopen_sensors():
            self._publish_return(name)

    def _hold_still(self) -> None:
        """Keep the link to the board alive while the lidar starts; put the start off for urgent requests."""
        if self.request_queue.is_urgent:
            raise ThumperError("a request waits")
        self.drive_manager.resend_command()

    def _publish_return(self, name: str) -> None:
        self.publisher.publish_event(f"the {name} answers again", name=name)

    def _fail(self, failure: _Failure) -> None:
        """End what is under way, the motors first; if the loop serves clients, continue to serve."""
        reason = str(failure.error)
        confirmed = True
        self.drive_manager.abort(reason)
        self.request_handler.experiments.drop(reason)
        if failure.board_answers or not self._is_serving:
            confirmed = self.stop()
        error = failure.error if confirmed else ThumperError(f"{reason}; {UNCONFIRMED}")
        silent = ThumperError(NO_TELEMETRY, exit_code=EXIT_NOT_THERE)
        self._tasks.fail(error, before_start=silent if reason == SILENT else failure.error)
        if self._is_serving and failure.reconnect:
            self._reconnection.begin(reason)

    def _reconnect(self) -> None:
        """Look for the lost board. The loop does not resume what it did before."""
        self.control_cycle.step_without_board(self._reconnection.reason)
        self._reconnection.step()
