"""The one loop of the robot: board and lidar in, perception and navigation, wheel speeds out.

It is single-threaded on purpose: the same bytes give the same run, and a stall of the computer is caught
by the board's own 300 ms time-out. The board's telemetry is the heartbeat; the lidar is drained after it.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from thumper.errors import ThumperError
from thumper.geometry import Pose2
from thumper.kinematics import DriveGeometry, WheelSpeeds, limit_wheel_speeds, wheel_speeds
from thumper.lidar.driver import LidarDriver
from thumper.link.board import Board, TelemetrySample
from thumper.link.messages import Command, Fault, State, Telemetry
from thumper.mapping.grid import OccupancyGrid
from thumper.mapping.mapper import Mapper
from thumper.mission_log import MissionLog, path_length_m
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.validate import validate_goal
from thumper.perception import Perception, Situation

TELEMETRY_TIMEOUT_S = 0.5
LATE_BEAT_S = 0.15  # a telemetry frame was lost on the way: the board must not miss a command for it
BLIND_S = 0.35  # without a new scan for this long (three turns) the robot must not move on
SCAN_TIMEOUT_S = 1.0  # ... and after this long the lidar is lost
FARTHEST_GOAL_M = 50.0  # the map of a whole drive must fit into memory and planning time
GOAL_MARGIN_M = 1.0
DISARMED_BEATS = 3  # telemetry from before ARM may still be on its way
STOP_BEATS = 30  # the firmware's ramp needs two seconds from the fastest speed it takes
FIRST_LOOK_SCANS = 3
FIRST_LOOK_TIMEOUT_S = 5.0

FAULT_CURES = {
    Fault.LINK_LOST: "it heard no command for 300 ms; is the computer overloaded or the cable loose?",
    Fault.LOW_BATTERY: "the battery is empty; charge it",
    Fault.E_STOP: "the emergency stop was pressed",
    Fault.STALL_LEFT: "the left wheels do not turn; are they blocked, is a motor or encoder wire loose?",
    Fault.STALL_RIGHT: "the right wheels do not turn; are they blocked, is a motor or encoder wire loose?",
    Fault.REVERSED_LEFT: "the left encoder counts backwards; swap its two wires, or the motor's",
    Fault.REVERSED_RIGHT: "the right encoder counts backwards; swap its two wires, or the motor's",
    Fault.LOST_EDGES: "an encoder's signal is disturbed; lead its wires away from the motors'",
    Fault.OVER_CURRENT: "a motor draws too much current; is something jammed?",
    Fault.WATCHDOG: "its firmware hung and was restarted; look at its supply",
    Fault.BAD_PARAMETERS: "its saved parameters cannot be read; set and save them again",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionResult:
    """How a drive to a goal ended."""

    reached: bool
    interrupted: bool  # by the user, with Ctrl-C
    reason: str
    time_s: float
    path_length_m: float
    map_from_base: Pose2  # where the robot believes it stopped


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """What a display needs once a beat."""

    time_s: float
    distance_to_goal_m: float
    reason: str


class Runtime:
    """The robot's parts, wired. Whatever ends a drive, the motors are stopped on the way out."""

    def __init__(
        self,
        *,
        board: Board,
        lidar: LidarDriver,
        perception: Perception,
        navigation: NavigationOptions,
        footprint: Footprint,
        drive: DriveGeometry,
        max_wheel_rad_s: float,
    ) -> None:
        self._board = board
        self._lidar = lidar
        self._perception = perception
        self._navigation = navigation
        self._footprint = footprint
        self._navigator = Navigator(navigation, footprint, drive)
        self._drive = drive
        self._max_wheel_rad_s = max_wheel_rad_s
        self._telemetry: Telemetry | None = None
        self._disarmed_beats = 0
        self._interrupted = False
        self._speeds = WheelSpeeds()  # as last commanded
        self.log = MissionLog()

    @property
    def mapper(self) -> Mapper:
        """The map so far, and where it says the robot is."""
        return self._perception.mapper

    def drive_to(
        self, goal: Goal, on_progress: Callable[[Progress], None], *, clear_fault: bool = False
    ) -> MissionResult:
        """Look round, arm, drive until the goal is reached or cannot be, stop and disarm.

        A link that was lost earlier is no fault any more; any other latched fault is cleared only on request.

        Raises
        ------
        ThumperError
            Before anything moves: no telemetry, no scan, a latched fault, or a goal that makes no sense.
        """
        start = self._look_round()
        self._check_goal(goal, start)
        self._navigator.set_goal(goal)
        self._interrupted = False
        self._check_fault(clear_fault)
        self._board.command(Command.ARM)
        try:
            reached, reason = self._drive_loop(goal, start.time_s, on_progress)
        finally:
            stopped = self._stop()
        if not stopped:
            reason += "; the board did not confirm the stop, it stops by itself after 300 ms without commands"
        end = self._perception.situation() or start
        return MissionResult(
            reached=reached,
            interrupted=self._interrupted,
            reason=reason,
            time_s=end.time_s - start.time_s,
            path_length_m=path_length_m(self.log.poses),
            map_from_base=end.map_from_base,
        )

    def _check_fault(self, clear_fault: bool) -> None:
        telemetry = self._telemetry
        if telemetry is None or telemetry.state is not State.FAULT:
            return
        if telemetry.fault is not Fault.LINK_LOST and not clear_fault:
            raise ThumperError(
                f"the board has latched a fault: {FAULT_CURES[telemetry.fault]}; "
                "when it is safe, run again with --clear-fault"
            )
        self._board.command(Command.CLEAR_FAULT)

    def _check_goal(self, goal: Goal, start: Situation) -> None:
        if goal.distance_m(start.map_from_base) > FARTHEST_GOAL_M:
            raise ThumperError(
                f"goal {goal} is outside any map that could be made on the way: "
                f"choose one within {FARTHEST_GOAL_M:.0f} m of the robot"
            )
        validate_goal(goal, self._grid_with(goal), self._footprint, self._navigation.costmap)

    def _grid_with(self, goal: Goal) -> OccupancyGrid:
        """The map so far, grown to hold the goal: it may lie where nobody has looked yet."""
        return self.mapper.grid().including(goal.x_m, goal.y_m, GOAL_MARGIN_M)

    def _look_round(self) -> Situation:
        """Stand still until the first scans are mapped: a plan needs a map."""
        waited_s = 0.0
        while self._perception.scans_mapped < FIRST_LOOK_SCANS:
            if waited_s > FIRST_LOOK_TIMEOUT_S:
                raise ThumperError(
                    "the lidar sends no scans in the board's time; is it powered, and the same robot's? "
                    "`thumper doctor --lidar PORT` tells more"
                )
            before = self._perception.situation()
            if not self._sense():
                raise ThumperError("the board went silent before the start; is the cable loose?")
            now = self._perception.situation()
            if before and now:
                waited_s += now.time_s - before.time_s
        situation = self._perception.situation()
        assert situation is not None  # a scan is only mapped once odometry covers it
        return situation

    def _drive_loop(
        self, goal: Goal, start_s: float, on_progress: Callable[[Progress], None]
    ) -> tuple[bool, str]:
        """Beat until the end; returns whether the goal was reached, and the reason in words."""
        try:
            while (ending := self._beat(goal, start_s, on_progress)) is None:
                pass
        except KeyboardInterrupt:
            self._interrupted = True
            return False, "interrupted"
        except ThumperError as error:
            return False, str(error)
        except Exception as error:  # in motion nothing may pass the stop that follows
            return False, f"internal error: {type(error).__name__}: {error}"
        return ending

    def _beat(
        self, goal: Goal, start_s: float, on_progress: Callable[[Progress], None]
    ) -> tuple[bool, str] | None:
        """One beat: sense, decide, act. None while under way, else as `_drive_loop`."""
        alive = self._sense(self._speeds)
        if self._board.restarted:
            return False, "the board has restarted on the way; look at its supply and cable"
        if not alive:
            return False, "the board went silent; it stops its motors by itself"
        situation = self._perception.situation()
        if situation is None or self._telemetry is None:
            return None
        if objection := self._objection(self._telemetry, situation):
            return False, objection
        if situation.scan_age_s > BLIND_S:
            self._speeds = WheelSpeeds()
            self._board.set_wheel_speeds(self._speeds)
            return None
        output = self._navigator.update(
            situation.time_s,
            situation.map_from_base,
            situation.twist,
            self._grid_with(goal),
            situation.hits_in_map_m,
        )
        self._speeds = limit_wheel_speeds(wheel_speeds(output.command, self._drive), self._max_wheel_rad_s)
        self._board.set_wheel_speeds(self._speeds)
        self.log.add_pose(situation.time_s, situation.map_from_base)
        self.log.add_plan(output.plan)
        on_progress(
            Progress(
                time_s=situation.time_s - start_s,
                distance_to_goal_m=goal.distance_m(situation.map_from_base),
                reason=output.reason,
            )
        )
        if output.state in (NavigationState.REACHED, NavigationState.FAILED):
            return output.state is NavigationState.REACHED, output.reason
        return None

    def _objection(self, telemetry: Telemetry, situation: Situation) -> str:
        """Why the drive cannot go on, or nothing."""
        if telemetry.state is State.FAULT:
            return f"the board stopped the motors: {FAULT_CURES[telemetry.fault]}"
        self._disarmed_beats = self._disarmed_beats + 1 if telemetry.state is State.DISARMED else 0
        if self._disarmed_beats > DISARMED_BEATS:
            return "somebody has disarmed the board"
        if situation.scan_age_s > SCAN_TIMEOUT_S:
            return "the lidar sends no more scans; is its cable loose?"
        return ""

    def _sense(self, standing_order: WheelSpeeds | None = None) -> bool:
        """Take in one beat of both ports; False when the board is silent.

        When a beat is late, `standing_order` is given once more, so that one lost frame is not a lost link.
        """
        samples = self._board.poll(LATE_BEAT_S)
        if not samples:
            if standing_order is not None:
                self._board.set_wheel_speeds(standing_order)
            samples = self._board.poll(TELEMETRY_TIMEOUT_S - LATE_BEAT_S)
        self._take_in(samples)
        for scan in self._lidar.poll():
            self._perception.add_scan(scan)
        return bool(samples)

    def _take_in(self, samples: list[TelemetrySample]) -> None:
        for sample in samples:
            self._telemetry = sample.telemetry
            self._perception.add_telemetry(sample)
            self.log.add_speeds(sample)

    def _stop(self) -> bool:
        """Zero speed until the wheels stand, then disarm; returns whether the board confirmed it.

        It runs on every way out: it never raises, and minds nothing but the board before that has stopped.
        Ctrl-C cuts the ramp short, never the disarming.
        """
        samples: list[TelemetrySample] = []
        confirmed = False
        try:
            with suppress(KeyboardInterrupt):
                for _ in range(STOP_BEATS):
                    self._board.set_wheel_speeds(WheelSpeeds())
                    heard = self._board.poll(TELEMETRY_TIMEOUT_S)
                    samples += heard
                    if not heard or _stands(heard[-1].telemetry):
                        break
            while not confirmed:
                with suppress(KeyboardInterrupt):
                    self._board.command(Command.DISARM)
                    confirmed = True
        except ThumperError:
            pass
        with suppress(Exception):  # a fault here must not hide how the drive ended
            self._take_in(samples)
        return confirmed


def _stands(telemetry: Telemetry) -> bool:
    return telemetry.left_speed == telemetry.right_speed == 0
