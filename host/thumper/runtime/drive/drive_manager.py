"""Decides once per cycle what the wheels do: follow a goal, obey manual commands, stop, or nothing.

All motion passes through here. Faults and emergency stops end a drive; manual commands override it.
A drive to a goal does not depend on the client that sent it; a manual command expires soon.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from thumper.board.board import Board
from thumper.board.fault_texts import FAULT_HINTS
from thumper.board.messages import Command, Fault, State, Telemetry
from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, WheelSpeeds, limit_wheel_speeds, wheel_speeds
from thumper.config.manual_drive import ManualDriveOptions
from thumper.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.runtime.drive.assisted_teleop import AssistedTeleop
from thumper.runtime.drive.data_age import DataAge
from thumper.runtime.drive.twist_mux import COMMAND_TIMEOUT_S, TwistMux
from thumper.runtime.requests import TeleopSource, Velocity
from thumper.runtime.safe_stop import STOP_CYCLES
from thumper.runtime.state_estimator import RobotState

GOAL_MARGIN_M, ROBOT_MARGIN_M = 1.0, 2.5  # more than half the controllers' usual window
DISARMED_CYCLES = 3  # telemetry from before ARM may still arrive
UNKNOWN_GOAL = "goal in unknown space, looking for a path"
TURNING, TURNING_BELOW_M_S = "turning in place", 0.02
RELEASED = "manual command released"
EMERGENCY_STOP = "emergency stop"
DRIVERS = {
    TeleopSource.VELOCITY: "driven by another program",
    TeleopSource.TELEOP: "driven by teleop",
    TeleopSource.GAMEPAD: "driven by gamepad",
}


class DriveMode(Enum):
    """What the robot is doing."""

    IDLE = "idle"  # motors off
    HOLDING = "holding"  # armed, held at speed zero
    DRIVING = "driving"  # to a goal
    MANUAL = "manual"  # by manual commands
    STOPPING = "stopping"  # slows down, then motors off


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveOutcome:
    """How a drive ended."""

    reached: bool
    reason: str
    by_user: bool = False  # stopped or overridden on request
    navigation_failed: bool = False  # the navigator gave up the goal
    drives_on: bool = False  # the next goal follows without a stop


class DriveManager:
    """The only commander of the board. `start`, `arm` and `disarm` raise ThumperError if it refuses."""

    def __init__(
        self,
        *,
        board: Board,
        navigator: Navigator,
        drive: DriveGeometry,
        max_wheel_rad_s: float,
        options: ManualDriveOptions,
        assisted_teleop: AssistedTeleop | None = None,
    ) -> None:
        self.board = board
        self.navigator = navigator
        self._drive = drive
        self._max_wheel_rad_s = max_wheel_rad_s
        self._options = options
        self._assisted_teleop = assisted_teleop
        self._override_until_s = -math.inf
        self.mux = TwistMux()
        self.mode = DriveMode.IDLE
        self.reason = ""
        self.goal: Goal | None = None
        self.task = ""  # what the drive to the goal is for
        self.outcome: DriveOutcome | None = None  # of the last drive, once it has ended
        self.command = Twist2()  # as last sent to the wheels
        self.stops = 0  # how often a client has stopped the robot or driven it manually
        self.is_waiting = False  # during a drive, for recent data; `reason` says for which
        self.is_stop_unconfirmed = False  # an emergency stop was requested, but the board did not confirm it
        self._data_age = DataAge()
        self._is_goal_unknown = False  # no scan has shown what is at the goal
        self._has_fault = False  # the board has latched one
        self._cruise = Twist2()
        self._speeds = WheelSpeeds()
        self._manually_armed = False
        self._cycles_armed = self._disarmed_cycles = self._stop_cycles = 0

    @property
    def activity(self) -> str:
        """Why the robot does what it does: the reason, or else what it drives for."""
        return self.reason or (self.task if self.mode is DriveMode.DRIVING else "")

    @property
    def remark(self) -> str:
        """What a progress display says of the robot: the reason, or what explains its present motion."""
        if self.reason or self.mode is not DriveMode.DRIVING:
            return self.reason
        if self.command.w_rad_s != 0.0 and abs(self.command.v_m_s) < TURNING_BELOW_M_S:
            return TURNING
        return UNKNOWN_GOAL if self._is_goal_unknown else ""

    @property
    def holds_still(self) -> bool:
        """Whether the robot is armed, and no one moves it."""
        return self.mode is DriveMode.HOLDING and self.command == Twist2()

    def start(
        self, goal: Goal, telemetry: Telemetry | None, *, task: str = "", clear_fault: bool = False
    ) -> None:
        """Arm and start to drive; a new goal replaces the current one. `task` says what the drive is for."""
        if self.mode in (DriveMode.IDLE, DriveMode.STOPPING):
            self._arm(telemetry, clear_fault=clear_fault)
        self.navigator.set_goal(goal)
        self._cruise = Twist2()  # of a motion that this goal replaces
        self.outcome, self.is_waiting, self._data_age = None, False, DataAge()
        self.goal, self.task = goal, task
        self.mode, self.reason = DriveMode.DRIVING, ""

    def arm(self, telemetry: Telemetry | None) -> None:
        """Switch the motors on and hold speed zero."""
        if self.mode is not DriveMode.DRIVING:
            self._arm(telemetry)
            self._speeds, self.mode, self.reason = WheelSpeeds(), DriveMode.HOLDING, "armed"
        self._manually_armed = True

    def cruise(self, twist: Twist2) -> None:
        """Hold this speed instead of zero until the robot stops; arm it first. Does not avoid obstacles."""
        self._cruise = twist

    def disarm(self, reason: str) -> None:
        """Switch the motors off immediately."""
        self._cancel_drive(reason, by_user=True)
        self._go_idle(reason)
        self.board.command(Command.DISARM)

    def emergency_stop(self) -> None:
        """Switch the motors off and latch the fault; raise ThumperError if the board does not confirm."""
        self.is_stop_unconfirmed = True
        self._cancel_drive(EMERGENCY_STOP, by_user=True)
        # If this command is lost, go silent all the same: the board then stops by its own time-out.
        self._go_idle(EMERGENCY_STOP)
        self._has_fault = True
        self.board.emergency_stop()
        self.is_stop_unconfirmed = False

    def clear_fault(self) -> None:
        """Clear the latched fault; the motors stay off."""
        self.board.command(Command.CLEAR_FAULT)
        self.is_stop_unconfirmed = False
        if self.mode is DriveMode.IDLE:
            self.reason = "fault cleared"

    def forget_reason(self) -> None:
        """Forget why the last drive ended: the map or the pose has changed since."""
        if self.mode is DriveMode.IDLE:
            self.reason = ""

    def stop(self, reason: str) -> None:
        """Cancel the drive, if there is one; slow down to a stop, then switch the motors off."""
        self._cancel_drive(reason, by_user=True)
        self.mux.clear()
        self._cruise = Twist2()
        if self.mode is not DriveMode.IDLE:
            self._speeds, self._stop_cycles = WheelSpeeds(), 0
            self.mode, self.reason = DriveMode.STOPPING, reason

    def add_manual_command(self, at_s: float, velocity: Velocity) -> None:
        """Add a manual command; it takes effect in the next step.

        A robot that stops ignores it: a program that repeats its command must not prevent the stop.
        """
        if self.mode in (DriveMode.IDLE, DriveMode.STOPPING) and velocity.twist != Twist2():
            # A fault must be cleared before. That of an emergency stop shows after a cycle or two.
            if self.mode is DriveMode.IDLE and not self._has_fault and self.reason != EMERGENCY_STOP:
                self.reason = "the motors are off; arm the robot to drive it manually"
            return
        self.mux.add(at_s, velocity)

    def override_assistance(self, at_s: float) -> None:
        """Let manual commands touch obstacles for a moment; repeat it while the operator holds the button."""
        self._override_until_s = at_s + COMMAND_TIMEOUT_S

    def resend_command(self) -> None:
        """Send the last command again, because a cycle is late."""
        if self.mode is not DriveMode.IDLE:
            self.board.set_wheel_speeds(self._speeds)

    def abort(self, reason: str) -> None:
        """End the drive: the board is unreachable, and its own time-out switches the motors off."""
        self._cancel_drive(reason)
        self._go_idle(reason)

    def on_stopped(self, reason: str = "") -> None:
        """Note that the caller has stopped the robot and switched the motors off, and why."""
        self._cancel_drive("stopped")
        self._go_idle(reason or self.reason)

    def step(
        self, telemetry: Telemetry, state: RobotState, grid: Callable[[], OccupancyGrid]
    ) -> NavigationOutput | None:
        """Decide and command the wheels; return the navigator's output if it ran."""
        self.command = Twist2()
        self._has_fault = telemetry.state is State.FAULT
        if stop_reason := self._stop_reason(telemetry):
            self._cancel_drive(stop_reason)
            self._go_idle(stop_reason)
            return None
        now_s = time.monotonic()
        manual = self.mux.active(now_s)
        if manual is not None or self.mode is not DriveMode.DRIVING:  # then the navigator does it itself
            self._observe(state, grid, parked=manual is None and self.mode is DriveMode.IDLE)
        if manual is not None and self.mode is not DriveMode.IDLE:
            twist, assistance = self._options.limit(manual.twist), ""
            if self._assisted_teleop is not None and now_s > self._override_until_s:
                obstacles = self.navigator.obstacles
                if manual.source is TeleopSource.VELOCITY:  # its planner judges unknown space
                    obstacles = obstacles.without_unseen()
                assisted = self._assisted_teleop.limit(twist, state, obstacles, grid)
                twist, assistance = assisted.twist, assisted.reason
            self._drive_manually(twist, DRIVERS[manual.source], assistance)
        elif self.mode is DriveMode.MANUAL:
            self.mode, self.reason = DriveMode.HOLDING, RELEASED
            self._send(self._cruise)
        elif self.mode is DriveMode.DRIVING:
            return self._navigate(state, grid)
        elif self.mode is DriveMode.STOPPING:
            self._brake(telemetry)
        elif self.mode is DriveMode.HOLDING:
            self._send(self._cruise)
        return None

    def _arm(self, telemetry: Telemetry | None, *, clear_fault: bool = False) -> None:
        if telemetry is not None and telemetry.state is State.FAULT:
            if telemetry.fault is not Fault.LINK_LOST and not clear_fault:
                hint = FAULT_HINTS[telemetry.fault]
                separator = " Clear" if hint.endswith("?") else "; clear"
                raise ThumperError(
                    f"the board has latched a fault: {hint}{separator} the fault when it is safe",
                    option="--clear-fault",
                )
            self.board.command(Command.CLEAR_FAULT)
        self.board.command(Command.ARM)
        self._cycles_armed = self._disarmed_cycles = 0

    def _stop_reason(self, telemetry: Telemetry) -> str:
        """Return why the robot must not move; empty if it may."""
        if self.mode is DriveMode.IDLE:
            return ""
        self._cycles_armed += 1
        if telemetry.state is State.FAULT and self._cycles_armed > 1:  # the first may be older than ARM
            return f"the board stopped the motors: {FAULT_HINTS[telemetry.fault]}"
        self._disarmed_cycles = self._disarmed_cycles + 1 if telemetry.state is State.DISARMED else 0
        return "another program disarmed the board" if self._disarmed_cycles > DISARMED_CYCLES else ""

    def _drive_manually(self, twist: Twist2, driver: str, assistance: str) -> None:
        """Follow a manual command in place of the goal; the robot stays armed after it."""
        self._cancel_drive(f"overridden: {driver}", by_user=True)
        self._manually_armed = True
        self.mode, self.reason = DriveMode.MANUAL, f"{driver}; {assistance}" if assistance else driver
        self._send(twist)

    def _observe(self, state: RobotState, grid: Callable[[], OccupancyGrid], *, parked: bool) -> None:
        """Let the navigator see what is round the robot, whoever drives it."""
        if state.frames is not None:
            x_m, y_m = state.map_from_base.x_m, state.map_from_base.y_m
            around = grid().including(x_m, y_m, ROBOT_MARGIN_M)
            self.navigator.observe(
                state.time_s,
                state.map_from_base,
                around,
                state.hits_in_map_m,
                lost=state.lost,
                frames=state.frames,
                parked=parked,
            )

    def _navigate(self, state: RobotState, grid: Callable[[], OccupancyGrid]) -> NavigationOutput | None:
        assert self.goal is not None  # DRIVING has one
        if self._waits_for_data(state):
            return None
        # Where the lidar reaches nothing, the map may end before the goal, and before the robot.
        x_m, y_m = state.map_from_base.x_m, state.map_from_base.y_m
        with_goal = grid().including(self.goal.x_m, self.goal.y_m, GOAL_MARGIN_M)
        goal_m = np.array(((self.goal.x_m, self.goal.y_m),))
        self._is_goal_unknown = bool(with_goal.values_at(goal_m)[0] == UNKNOWN)
        output = self.navigator.update(
            state.time_s,
            state.map_from_base,
            state.twist,
            with_goal.including(x_m, y_m, ROBOT_MARGIN_M),
            state.hits_in_map_m,
            lost=state.lost,
            frames=state.frames,
        )
        if self._waits_for_data(state):  # planning may have taken seconds
            return None
        self.is_waiting = False
        self.reason = output.reason
        self._send(output.command)
        if output.state is NavigationState.REACHED:
            self._end_drive(DriveOutcome(reached=True, reason=output.reason))
        elif output.state is NavigationState.FAILED:
            self._end_drive(DriveOutcome(reached=False, reason=output.reason, navigation_failed=True))
        return output

    def _waits_for_data(self, state: RobotState) -> bool:
        """Hold still, and return True, if the data is too old to drive on; after a while, end the drive."""
        problem = self._data_age.problem(state, self.board.now_s())
        if problem and self._data_age.is_hopeless(state):
            self._end_drive(DriveOutcome(reached=False, reason=problem))
        elif problem:
            self._speeds, self.reason, self.is_waiting = WheelSpeeds(), problem, True
            self.board.set_wheel_speeds(self._speeds)
        return bool(problem)

    def _end_drive(self, outcome: DriveOutcome) -> None:
        """End the drive regularly: slow down, then motors off unless the user armed the robot."""
        self.outcome, self.goal = outcome, None
        self._speeds, self._stop_cycles, self.reason = WheelSpeeds(), 0, outcome.reason
        self.mode = DriveMode.HOLDING if self._manually_armed else DriveMode.STOPPING

    def _brake(self, telemetry: Telemetry) -> None:
        self._stop_cycles += 1
        if telemetry.left_speed == telemetry.right_speed == 0 or self._stop_cycles > STOP_CYCLES:
            self.board.command(Command.DISARM)
            self._go_idle(self.reason)
        else:
            self.board.set_wheel_speeds(WheelSpeeds())

    def _send(self, twist: Twist2) -> None:
        """Send the twist as wheel speeds; if a wheel is too slow for it, slow both down alike."""
        self.command = twist
        self._speeds = limit_wheel_speeds(wheel_speeds(twist, self._drive), self._max_wheel_rad_s)
        self.board.set_wheel_speeds(self._speeds)

    def _cancel_drive(self, reason: str, *, by_user: bool = False) -> None:
        self.stops += by_user
        if self.goal is not None:
            self.outcome = DriveOutcome(reached=False, reason=reason, by_user=by_user)
            self.goal = None

    def _go_idle(self, reason: str) -> None:
        self._cruise = Twist2()
        self._manually_armed, self._speeds = False, WheelSpeeds()
        self.mux.clear()
        self.mode, self.reason = DriveMode.IDLE, reason
