"""A leg under way: starts it, and decides when it has ended."""

from dataclasses import dataclass

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode, DriveOutcome
from thumper.runtime.drive.goal_limits import GoalLimits
from thumper.runtime.drive.legs import AnyLeg, Cruise, Leg, Move, Wait
from thumper.runtime.drive.motions import MotionEnd
from thumper.runtime.drive.start_gate import StartGate
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.state_estimator import RobotState

RESTARTED = "the board has restarted; check its supply and cable"
MOVED_M = 0.5  # a robot that is nearer to where it was stays in one place
DONE = DriveOutcome(reached=True, reason="done")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Start:
    """Where and when the leg started."""

    time_s: float
    driven_m: float
    map_from_base: Pose2


class LegRun:
    """One leg from the wait before it to its result."""

    def __init__(
        self, leg: AnyLeg, inputs: SensorInputs, drive_manager: DriveManager, goal_limits: GoalLimits
    ) -> None:
        self.leg = leg
        self._inputs = inputs
        self._drive_manager = drive_manager
        self._goal_limits = goal_limits
        self._gate = StartGate(inputs)
        self._begun: _Start | None = None
        self._first_s: float | None = None  # time after the first cycle
        self._anchor: RobotState | None = None  # since when the robot has stayed in one place
        self._cycles = 0
        self._motors_on = False  # at the start of a wait
        self._reason_before = ""  # what the robot reported before a wait
        self._stops_before = drive_manager.stops

    @property
    def has_started(self) -> bool:
        """Whether the robot may move."""
        return self._begun is not None

    @property
    def moves(self) -> bool:
        """Whether the leg drives the wheels."""
        return not isinstance(self.leg, Wait)

    @property
    def is_done_at_once(self) -> bool:
        """Whether the leg only waited for its start."""
        return self.has_started and isinstance(self.leg, Wait) and self.leg.duration_s == 0.0

    def start_if_ready(self) -> None:
        """Start the leg if it has not started and the robot is ready for it.

        Raises
        ------
        ThumperError
            The leg is refused: no scans, a latched fault, an impossible goal. Nothing has moved.
        """
        if not self.has_started and self._gate.is_open():
            self.start()

    def start(self) -> None:
        """Start the leg now.

        Raises
        ------
        ThumperError
            As `start_if_ready`.
        """
        state, manager = self._inputs.estimator.state(), self._drive_manager
        if self._inputs.board.restarted:
            raise ThumperError(RESTARTED)
        assert state is not None  # there is a map
        start = _Start(
            time_s=state.time_s, driven_m=self._inputs.estimator.driven_m, map_from_base=state.map_from_base
        )
        match self.leg:
            case Leg():
                self._goal_limits.check(self.leg.goal)
                manager.start(
                    self.leg.goal,
                    self._inputs.telemetry,
                    task=self.leg.task,
                    clear_fault=self.leg.clear_fault,
                )
            case Cruise():
                manager.arm(self._inputs.telemetry)
                manager.cruise(self.leg.twist)
            case Move():
                manager.arm(self._inputs.telemetry)
                manager.cruise(Twist2())  # until the motion's first command
            case Wait():
                self._motors_on = manager.mode is DriveMode.HOLDING
                self._reason_before = manager.reason
                if self.leg.duration_s > 0.0:
                    manager.reason = self.leg.name
        self._begun = start

    def outcome(self) -> DriveOutcome | None:
        """Return how the leg ended, once it has. Call it once after each cycle of a started leg."""
        match self.leg:
            case Leg():
                return self._drive_manager.outcome or self._early_end(self.leg)
            case Cruise():
                if self._drive_manager.mode is DriveMode.IDLE:
                    return DriveOutcome(reached=False, reason=self._drive_manager.reason)
                return DONE if self._elapsed_s() >= self.leg.duration_s else None
            case Move():
                return self._follow(self.leg)
            case Wait():
                return self._waited(self.leg)

    def _waited(self, leg: Wait) -> DriveOutcome | None:
        manager = self._drive_manager
        self._cycles += 1
        by_user = manager.stops > self._stops_before
        if by_user or (self._motors_on and manager.mode is DriveMode.IDLE):  # by a fault
            reason = "cancelled" if manager.reason in ("", leg.name) else manager.reason
            return DriveOutcome(reached=False, reason=reason, by_user=by_user)
        is_over = leg.until() or self._cycles >= leg.max_cycles or self._elapsed_s() >= leg.duration_s
        if is_over and manager.reason == leg.name:
            manager.reason = self._reason_before
        return DONE if is_over else None

    def _follow(self, leg: Move) -> DriveOutcome | None:
        """Pass on the next command of a motion, or return how it ended."""
        by_user = self._drive_manager.stops > self._stops_before
        if by_user or self._drive_manager.mode is DriveMode.IDLE:
            return DriveOutcome(reached=False, reason=self._drive_manager.reason, by_user=by_user)
        state = self._inputs.estimator.state()
        assert state is not None  # the leg has started
        command = leg.motion(state)
        if isinstance(command, MotionEnd):
            self._drive_manager.cruise(Twist2())
            return DriveOutcome(reached=command.done, reason=command.reason)
        self._drive_manager.cruise(command)
        return None

    def _early_end(self, leg: Leg) -> DriveOutcome | None:
        """Return how the leg itself ends the drive to its goal, if it does."""
        if leg.until():
            return DriveOutcome(reached=True, reason="done", drives_on=True)
        state = self._inputs.estimator.state()
        assert state is not None  # the leg has started
        if self._anchor is None or self._anchor.map_from_base.distance_m(state.map_from_base) > MOVED_M:
            self._anchor = state
        idle_s = state.time_s - self._anchor.time_s
        if idle_s <= leg.patience_s:
            return None
        reason = f"stayed in one place for {idle_s:.0f} s"
        if self._drive_manager.reason:
            reason += f"; {self._drive_manager.reason}"
        return DriveOutcome(reached=False, reason=reason, navigation_failed=True)

    def progress(self) -> DriveProgress | None:
        """Return the progress of a drive to a goal after a cycle; None for other legs."""
        state = self._inputs.estimator.state()
        if not isinstance(self.leg, Leg) or self._begun is None or state is None:
            return None
        return DriveProgress(
            time_s=state.time_s - self._begun.time_s,
            distance_to_goal_m=self.leg.goal.distance_m(state.map_from_base),
            remark=self._drive_manager.remark,
        )

    def result(self, outcome: DriveOutcome) -> DriveResult:
        """Return the result of the leg, which has ended."""
        estimator = self._inputs.estimator
        state, begun = estimator.state(), self._begun
        return DriveResult(
            reached=outcome.reached,
            interrupted=outcome.by_user,
            reason=outcome.reason,
            time_s=state.time_s - begun.time_s if state and begun else 0.0,
            path_length_m=estimator.driven_m - begun.driven_m if begun else 0.0,
            pose=state.map_from_base if state else Pose2(),
            navigation_failed=outcome.navigation_failed,
        )

    def _elapsed_s(self) -> float:
        """Return the time since the first cycle: the first command was sent in it."""
        state = self._inputs.estimator.state()
        assert state is not None  # the leg has started
        self._first_s = state.time_s if self._first_s is None else self._first_s
        return state.time_s - self._first_s
