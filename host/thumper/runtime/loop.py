"""The one loop of the robot: board and lidar in, estimator and navigation, wheel speeds out.

It is single-threaded on purpose: the same bytes give the same run, and a stall of the computer is caught
by the board's own 300 ms time-out. The board's telemetry is the heartbeat; the lidar is drained after it.
Requests wait in a queue until the next cycle handles them. Published messages go to sinks, which must not
block.
"""

import time
from collections.abc import Callable
from contextlib import suppress

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import DriveGeometry
from thumper.common.signals import raise_lost_interrupt
from thumper.config.manual_drive import ManualDriveOptions
from thumper.lidar.driver import LidarDriver
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.goal_validation import validate_goal
from thumper.ros.to_ros import ERROR
from thumper.runtime.drive.drive_manager import GOAL_MARGIN_M, DriveManager, DriveMode, DriveOutcome
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.publisher import LoopTiming, Publisher
from thumper.runtime.real_time_rate import RealTimeRate
from thumper.runtime.requests import EmergencyStop
from thumper.runtime.safe_stop import stop_and_disarm
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.request_handler import RequestHandler
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.service.simulator_control import Simulator
from thumper.runtime.state_estimator import RobotState, StateEstimator
from thumper.slam.mapper import Mapper

RECONNECT_PERIOD_S = 0.5
MAX_SILENT_CYCLES = 3  # of half a second each
SILENT = "the board went silent; it stops its motors by itself"
MAX_GOAL_DISTANCE_M = 50.0  # the map of a whole drive must fit into memory and planning time


class RobotLoop:
    """The robot's parts, wired. Whatever ends a drive, the motors are stopped on the way out."""

    def __init__(
        self,
        *,
        board: Board,
        lidar: LidarDriver,
        estimator: StateEstimator,
        navigation: NavigationOptions,
        footprint: Footprint,
        drive: DriveGeometry,
        max_wheel_rad_s: float,
        publisher: Publisher,
        view: FieldOfView | None = None,
        service: ManualDriveOptions | None = None,
        open_board: Callable[[], Board],
        open_lidar: Callable[[], LidarDriver] | None = None,
        simulator: Simulator | None = None,
    ) -> None:
        self.inputs = SensorInputs(board=board, lidar=lidar, estimator=estimator, open_lidar=open_lidar)
        self.publisher = publisher
        self.request_queue = RequestQueue()
        self._navigation = navigation
        self._footprint = footprint
        self.drive_manager = DriveManager(
            board=board,
            navigator=Navigator(
                navigation, footprint, drive, view=view, on_transition=self.inputs.log_transition
            ),
            drive=drive,
            max_wheel_rad_s=max_wheel_rad_s,
            options=service or ManualDriveOptions(),
        )
        self.request_handler = RequestHandler(
            request_queue=self.request_queue,
            drive_manager=self.drive_manager,
            inputs=self.inputs,
            publisher=publisher,
            check_goal=self._check_goal,
            simulator=simulator,
        )
        self._open_board = open_board
        self._rate = RealTimeRate(self._now_s, paced=board.port.has_simulated_clock)
        self._silent_cycles = 0
        self._timing = LoopTiming()

    @property
    def mapper(self) -> Mapper:
        """The map so far, and where it says the robot is."""
        return self.inputs.estimator.mapper

    @property
    def log(self) -> DriveLog:
        """What the drives so far leave for plots and tables."""
        return self.inputs.log

    def wait_for_map(self) -> RobotState:
        """Stand until the first scans are mapped; from now on no goals come but from the caller.

        Raises
        ------
        ThumperError
            The board is silent, or the lidar is.
        """
        self.request_handler.accepts_goals = False
        return self.inputs.wait_for_map(lambda: self.step()[0])

    def drive_to(
        self, goal: Goal, on_progress: Callable[[DriveProgress], None], *, clear_fault: bool = False
    ) -> DriveResult:
        """Look round, arm, drive until the goal is reached or cannot be, stop and disarm.

        A link that was lost earlier is no fault any more; any other latched fault is cleared only on request.

        Raises
        ------
        ThumperError
            Before anything moves: no telemetry, no scan, a latched fault, or a goal that makes no sense.
        """
        start = self.wait_for_map()
        driven_m = self.inputs.estimator.driven_m
        self._check_goal(goal)
        self.drive_manager.start(goal, self.inputs.telemetry, clear_fault=clear_fault)
        interrupted = False
        try:
            ending = self._drive(goal, start.time_s, on_progress)
        except KeyboardInterrupt:
            interrupted, ending = True, DriveOutcome(reached=False, reason="interrupted")
        finally:
            stopped = self.stop()
        reason = ending.reason
        if not stopped:
            reason += "; the board did not confirm the stop, it stops by itself after 300 ms without commands"
        end = self.inputs.estimator.state() or start
        return DriveResult(
            reached=ending.reached,
            interrupted=interrupted or ending.by_user,
            reason=reason,
            time_s=end.time_s - start.time_s,
            path_length_m=self.inputs.estimator.driven_m - driven_m,
            map_from_base=end.map_from_base,
        )

    def serve(self, *, speed: float = 1.0) -> None:
        """Sense, map and do what is asked for until Ctrl-C; then stop and disarm.

        A simulated robot is kept at `speed` times the clock on the wall.

        When the board is lost its motors go off by its own time-out; it is looked for until it answers.
        """
        self.request_handler.accepts_goals, self.inputs.keep_log = True, False
        self._rate.set_speed(speed)
        self.request_handler.simulation.set_speed = self._rate.set_speed
        try:
            while True:
                self.serve_step()
                self._rate.wait()
        except KeyboardInterrupt:
            pass
        finally:
            self.stop()

    def _experiment(self) -> None:
        """Lend the board out; at each of its beats the rest of the loop goes on, but for deciding."""
        experiments, heartbeats = self.request_handler.experiments, self.drive_manager.heartbeats

        @raise_lost_interrupt()
        def beat(samples: list[TelemetrySample]) -> None:
            self.inputs.add_telemetry(samples)
            self.inputs.read_scans()
            self.request_handler.process_pending()
            armed = self.inputs.telemetry is not None and self.inputs.telemetry.state is not State.DISARMED
            if heartbeats.is_lost(experiments.source, time.monotonic()) and armed:
                experiments.stop("the page that began it is gone")
            self.publisher.publish(self.inputs, self.drive_manager, None, self._timing)
            if samples:
                self.request_handler.board_jobs.run_for(self._now_s)
            self._rate.wait()

        self.publisher.publish_event(f"{experiments.requested} begins")
        ending = experiments.run(self.inputs.board, beat)
        self.stop()
        self.publisher.publish_event(ending)

    def serve_step(self) -> None:
        """One beat at service: whatever goes wrong in it, the robot stops and the next beat follows."""
        try:
            self._silent_cycles = 0 if self.step()[0] else self._silent_cycles + 1
            if self._silent_cycles:
                self.drive_manager.abort(SILENT)
            self.request_handler.advance_mission()
            if self.inputs.board.restarted:
                self._reconnect("the board has restarted; look at its supply and cable")
            elif self._silent_cycles > MAX_SILENT_CYCLES:
                self._reconnect(SILENT)
            elif self.request_handler.experiments.requested and not self.request_handler.board_jobs:
                self._experiment()
            elif self.drive_manager.mode is DriveMode.IDLE and self.inputs.reopen_lidar():
                self.publisher.publish_event("the lidar answers again", name="lidar")
        except ThumperError as error:
            self._reconnect(str(error))
        except Exception as error:  # in motion nothing may pass the stop that follows
            self.drive_manager.abort(f"internal error: {type(error).__name__}: {error}")
            self.stop()
            self.request_handler.advance_mission()

    def _reconnect(self, why: str) -> None:
        """The board is out of reach and stops its motors by itself: try until it answers, then go on.

        What was asked for is not taken up again.
        """
        self.drive_manager.abort(why)
        self.request_handler.advance_mission()
        self.publisher.publish_event(why, ERROR, name="board")
        must_latch = False
        while True:
            self.inputs.samples, self.inputs.scans = [], self.inputs.lidar.poll()
            self.publisher.publish(self.inputs, self.drive_manager, None, self._timing)
            must_latch |= self.request_handler.refuse(why)
            self.inputs.board.close()
            try:
                board = self._open_board()
            except ThumperError:
                time.sleep(RECONNECT_PERIOD_S)
                continue
            self.inputs.replace_board(board)
            self.drive_manager.board = board
            self.publisher.publish_event("the board answers again; the motors are off", name="board")
            self.drive_manager.reason = ""
            if must_latch:
                self.request_queue.put(EmergencyStop())
            return

    def _now_s(self) -> float:
        return self.inputs.board.now_s()  # the board may be another one than at the start

    def _drive(
        self, goal: Goal, start_s: float, on_progress: Callable[[DriveProgress], None]
    ) -> DriveOutcome:
        """Beat until the end."""
        try:
            while True:
                alive, output = self.step()
                if self.inputs.board.restarted:
                    return DriveOutcome(
                        reached=False,
                        reason="the board has restarted on the way; look at its supply and cable",
                    )
                if not alive:
                    return DriveOutcome(reached=False, reason=SILENT)
                state = self.inputs.estimator.state()
                if output is not None and state is not None:
                    self.log.add_pose(state.time_s, state.map_from_base)
                    self.log.add_plan(output.plan)
                    on_progress(
                        DriveProgress(
                            time_s=state.time_s - start_s,
                            distance_to_goal_m=goal.distance_m(state.map_from_base),
                            reason=output.reason,
                        )
                    )
                if self.drive_manager.outcome is not None:
                    return self.drive_manager.outcome
        except ThumperError as error:
            return DriveOutcome(reached=False, reason=str(error))
        except Exception as error:  # in motion nothing may pass the stop that follows
            return DriveOutcome(reached=False, reason=f"internal error: {type(error).__name__}: {error}")

    @raise_lost_interrupt()
    def step(self) -> tuple[bool, NavigationOutput | None]:
        """One beat: sense, heed, decide, act, tell. Returns whether the board was heard, and the decision."""
        alive = self.inputs.read(self.drive_manager.resend_command)
        begun_s = time.perf_counter()
        state = self.inputs.estimator.state()
        late_s = self.inputs.board.now_s() - state.time_s if state else 0.0
        self.request_handler.process_pending()
        output = None
        if alive and state is not None and self.inputs.telemetry is not None:
            output = self.drive_manager.step(self.inputs.telemetry, state, self.mapper.grid)
        self.publisher.publish(self.inputs, self.drive_manager, output, self._timing)
        if alive:
            self.request_handler.board_jobs.run_for(self._now_s)
        self._timing = LoopTiming(late_s=late_s, busy_s=time.perf_counter() - begun_s)
        return alive, output

    def _check_goal(self, goal: Goal) -> None:
        state = self.inputs.estimator.state()
        assert state is not None  # nobody asks before the robot has looked
        if goal.distance_m(state.map_from_base) > MAX_GOAL_DISTANCE_M:
            raise ThumperError(
                f"goal {goal} is outside any map that could be made on the way: "
                f"choose one within {MAX_GOAL_DISTANCE_M:.0f} m of the robot"
            )
        grid = self.mapper.grid().including(goal.x_m, goal.y_m, GOAL_MARGIN_M)
        validate_goal(goal, grid, self._footprint, self._navigation.costmap)

    def stop(self) -> bool:
        """Stop and disarm; returns whether the board confirmed it.

        It runs on every way out: it never raises, and minds nothing but the board before that has stopped.
        """
        samples, confirmed = stop_and_disarm(self.inputs.board)
        with suppress(Exception):  # a fault here must not hide how the drive ended
            self.inputs.add_telemetry(samples)
            self.inputs.scans = []
            self.publisher.publish(
                self.inputs, self.drive_manager, None, self._timing
            )  # a recording holds the stop too
        self.drive_manager.on_stopped()
        return confirmed
