"""The one loop of the robot: board and lidar in, perception and navigation, wheel speeds out.

It is single-threaded on purpose: the same bytes give the same run, and a stall of the computer is caught
by the board's own 300 ms time-out. The board's telemetry is the heartbeat; the lidar is drained after it.
What others ask for waits in the inbox until the beat takes it, and what is made goes to listeners that must
not make the loop wait.
"""

import time
from collections.abc import Callable
from contextlib import suppress

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import DriveGeometry
from thumper.common.serial_port import simulates
from thumper.common.signals import none_lost
from thumper.config.manual_drive import ManualDriveOptions
from thumper.lidar.driver import LidarDriver
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.goal_validation import validate_goal
from thumper.ros.to_ros import ERROR
from thumper.runtime.drive.drive_manager import GOAL_MARGIN_M, DriveManager, DriveMode, Ending
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
MOST_SILENT_BEATS = 3  # of half a second each
SILENT = "the board went silent; it stops its motors by itself"
FARTHEST_GOAL_M = 50.0  # the map of a whole drive must fit into memory and planning time


class RobotLoop:
    """The robot's parts, wired. Whatever ends a drive, the motors are stopped on the way out."""

    def __init__(
        self,
        *,
        board: Board,
        lidar: LidarDriver,
        perception: StateEstimator,
        navigation: NavigationOptions,
        footprint: Footprint,
        drive: DriveGeometry,
        max_wheel_rad_s: float,
        products: Publisher,
        view: FieldOfView | None = None,
        service: ManualDriveOptions | None = None,
        open_board: Callable[[], Board],
        open_lidar: Callable[[], LidarDriver] | None = None,
        simulator: Simulator | None = None,
    ) -> None:
        self.senses = SensorInputs(board=board, lidar=lidar, perception=perception, open_lidar=open_lidar)
        self.products = products
        self.inbox = RequestQueue()
        self._navigation = navigation
        self._footprint = footprint
        self.pilot = DriveManager(
            board=board,
            navigator=Navigator(
                navigation, footprint, drive, view=view, on_transition=self.senses.note_transition
            ),
            drive=drive,
            max_wheel_rad_s=max_wheel_rad_s,
            options=service or ManualDriveOptions(),
        )
        self.desk = RequestHandler(
            inbox=self.inbox,
            pilot=self.pilot,
            senses=self.senses,
            products=products,
            check_goal=self._check_goal,
            simulator=simulator,
        )
        self._open_board = open_board
        self._pacer = RealTimeRate(self._now_s, paced=simulates(board.port))
        self._silent_beats = 0
        self._timing = LoopTiming()

    @property
    def mapper(self) -> Mapper:
        """The map so far, and where it says the robot is."""
        return self.senses.perception.mapper

    @property
    def log(self) -> DriveLog:
        """What the drives so far leave for plots and tables."""
        return self.senses.log

    def look_round(self) -> RobotState:
        """Stand until the first scans are mapped; from now on no goals come but from the caller.

        Raises
        ------
        ThumperError
            The board is silent, or the lidar is.
        """
        self.desk.takes_goals = False
        return self.senses.look_round(lambda: self.beat()[0])

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
        start = self.look_round()
        driven_m = self.senses.perception.driven_m
        self._check_goal(goal)
        self.pilot.start(goal, self.senses.telemetry, clear_fault=clear_fault)
        interrupted = False
        try:
            ending = self._drive(goal, start.time_s, on_progress)
        except KeyboardInterrupt:
            interrupted, ending = True, Ending(reached=False, reason="interrupted")
        finally:
            stopped = self.stop()
        reason = ending.reason
        if not stopped:
            reason += "; the board did not confirm the stop, it stops by itself after 300 ms without commands"
        end = self.senses.perception.situation() or start
        return DriveResult(
            reached=ending.reached,
            interrupted=interrupted or ending.by_user,
            reason=reason,
            time_s=end.time_s - start.time_s,
            path_length_m=self.senses.perception.driven_m - driven_m,
            map_from_base=end.map_from_base,
        )

    def serve(self, *, speed: float = 1.0) -> None:
        """Sense, map and do what is asked for until Ctrl-C; then stop and disarm.

        A simulated robot is kept at `speed` times the clock on the wall.

        When the board is lost its motors go off by its own time-out; it is looked for until it answers.
        """
        self.desk.takes_goals, self.senses.keeps_log = True, False
        self._pacer.set_speed(speed)
        self.desk.simulation.set_speed = self._pacer.set_speed
        try:
            while True:
                self.serve_beat()
                self._pacer.wait()
        except KeyboardInterrupt:
            pass
        finally:
            self.stop()

    def _experiment(self) -> None:
        """Lend the board out; at each of its beats the rest of the loop goes on, but for deciding."""
        experiments, supervision = self.desk.experiments, self.pilot.supervision

        @none_lost()
        def beat(samples: list[TelemetrySample]) -> None:
            self.senses.take_in(samples)
            self.senses.take_scans()
            self.desk.attend()
            armed = self.senses.telemetry is not None and self.senses.telemetry.state is not State.DISARMED
            if supervision.is_lost(experiments.source, time.monotonic()) and armed:
                experiments.stop("the page that began it is gone")
            self.products.beat(self.senses, self.pilot, None, self._timing)
            if samples:
                self.desk.errands.go_on(self._now_s)
            self._pacer.wait()

        self.products.event(f"{experiments.wanted} begins")
        ending = experiments.run(self.senses.board, beat)
        self.stop()
        self.products.event(ending)

    def serve_beat(self) -> None:
        """One beat at service: whatever goes wrong in it, the robot stops and the next beat follows."""
        try:
            self._silent_beats = 0 if self.beat()[0] else self._silent_beats + 1
            if self._silent_beats:
                self.pilot.give_up(SILENT)
            self.desk.follow_up()
            if self.senses.board.restarted:
                self._reconnect("the board has restarted; look at its supply and cable")
            elif self._silent_beats > MOST_SILENT_BEATS:
                self._reconnect(SILENT)
            elif self.desk.experiments.wanted and not self.desk.errands:
                self._experiment()
            elif self.pilot.mode is DriveMode.IDLE and self.senses.reopen_lidar():
                self.products.event("the lidar answers again", name="lidar")
        except ThumperError as error:
            self._reconnect(str(error))
        except Exception as error:  # in motion nothing may pass the stop that follows
            self.pilot.give_up(f"internal error: {type(error).__name__}: {error}")
            self.stop()
            self.desk.follow_up()

    def _reconnect(self, why: str) -> None:
        """The board is out of reach and stops its motors by itself: try until it answers, then go on.

        What was asked for is not taken up again.
        """
        self.pilot.give_up(why)
        self.desk.follow_up()
        self.products.event(why, ERROR, name="board")
        must_latch = False
        while True:
            self.senses.samples, self.senses.scans = [], self.senses.lidar.poll()
            self.products.beat(self.senses, self.pilot, None, self._timing)
            must_latch |= self.desk.refuse(why)
            self.senses.board.close()
            try:
                board = self._open_board()
            except ThumperError:
                time.sleep(RECONNECT_PERIOD_S)
                continue
            self.senses.replace_board(board)
            self.pilot.board = board
            self.products.event("the board answers again; the motors are off", name="board")
            self.pilot.reason = ""
            if must_latch:
                self.inbox.put(EmergencyStop())
            return

    def _now_s(self) -> float:
        return self.senses.board.now_s()  # the board may be another one than at the start

    def _drive(self, goal: Goal, start_s: float, on_progress: Callable[[DriveProgress], None]) -> Ending:
        """Beat until the end."""
        try:
            while True:
                alive, output = self.beat()
                if self.senses.board.restarted:
                    return Ending(
                        reached=False,
                        reason="the board has restarted on the way; look at its supply and cable",
                    )
                if not alive:
                    return Ending(reached=False, reason=SILENT)
                situation = self.senses.perception.situation()
                if output is not None and situation is not None:
                    self.log.add_pose(situation.time_s, situation.map_from_base)
                    self.log.add_plan(output.plan)
                    on_progress(
                        DriveProgress(
                            time_s=situation.time_s - start_s,
                            distance_to_goal_m=goal.distance_m(situation.map_from_base),
                            reason=output.reason,
                        )
                    )
                if self.pilot.ending is not None:
                    return self.pilot.ending
        except ThumperError as error:
            return Ending(reached=False, reason=str(error))
        except Exception as error:  # in motion nothing may pass the stop that follows
            return Ending(reached=False, reason=f"internal error: {type(error).__name__}: {error}")

    @none_lost()
    def beat(self) -> tuple[bool, NavigationOutput | None]:
        """One beat: sense, heed, decide, act, tell. Returns whether the board was heard, and the decision."""
        alive = self.senses.beat(self.pilot.repeat)
        begun_s = time.perf_counter()
        situation = self.senses.perception.situation()
        late_s = self.senses.board.now_s() - situation.time_s if situation else 0.0
        self.desk.attend()
        output = None
        if alive and situation is not None and self.senses.telemetry is not None:
            output = self.pilot.step(self.senses.telemetry, situation, self.mapper.grid)
        self.products.beat(self.senses, self.pilot, output, self._timing)
        if alive:
            self.desk.errands.go_on(self._now_s)
        self._timing = LoopTiming(late_s=late_s, busy_s=time.perf_counter() - begun_s)
        return alive, output

    def _check_goal(self, goal: Goal) -> None:
        situation = self.senses.perception.situation()
        assert situation is not None  # nobody asks before the robot has looked
        if goal.distance_m(situation.map_from_base) > FARTHEST_GOAL_M:
            raise ThumperError(
                f"goal {goal} is outside any map that could be made on the way: "
                f"choose one within {FARTHEST_GOAL_M:.0f} m of the robot"
            )
        grid = self.mapper.grid().including(goal.x_m, goal.y_m, GOAL_MARGIN_M)
        validate_goal(goal, grid, self._footprint, self._navigation.costmap)

    def stop(self) -> bool:
        """Stop and disarm; returns whether the board confirmed it.

        It runs on every way out: it never raises, and minds nothing but the board before that has stopped.
        """
        samples, confirmed = stop_and_disarm(self.senses.board)
        with suppress(Exception):  # a fault here must not hide how the drive ended
            self.senses.take_in(samples)
            self.senses.scans = []
            self.products.beat(self.senses, self.pilot, None, self._timing)  # a recording holds the stop too
        self.pilot.settle()
        return confirmed
