"""Drive the robot to a goal: plan, control, recover, check the command; one `update` per cycle.

Pure: time and sensor data in, a twist out. `update` never raises: an error is a stop with a reason.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.final_approach import FinalApproach
from thumper.navigation.controllers.goal_checker import GoalChecker
from thumper.navigation.controllers.path_follower import PathFollower
from thumper.navigation.controllers.speed_limiter import SpeedLimiter
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.filters import load_masks
from thumper.navigation.costmap.local_model import LocalModel
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.goal_validation import validate_goal
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.planners.replanning import PathManager
from thumper.navigation.recovery.motion_watchdog import MotionWatchdog
from thumper.navigation.recovery.recovery_policy import RecoveryPolicy
from thumper.navigation.registry import make_controller, make_planner
from thumper.navigation.safety.command_filter import CommandFilter
from thumper.navigation.speed_limits import is_still
from thumper.navigation.state import NavigationOutput, NavigationState, Stop, Transition, TransitionLog

__all__ = ["NavigationOutput", "NavigationState", "Navigator"]

USUAL_PERIOD_S = 0.1
MIN_PERIOD_S, MAX_PERIOD_S = 0.02, 0.3
FINAL_STATES = (NavigationState.REACHED, NavigationState.FAILED)


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveGoal:
    """A goal and the parts of the navigator that last as long as it."""

    goal: Goal
    checker: GoalChecker
    recovery: RecoveryPolicy


class Navigator:
    """Drives one robot to one goal at a time.

    `on_transition` is called at every change of state. Raises ThumperError, with exit code 2, for an unknown
    planner or controller and for a mask that cannot be read.
    """

    def __init__(
        self,
        options: NavigationOptions,
        footprint: Footprint,
        drive: DriveGeometry | None = None,
        *,
        view: FieldOfView | None = None,
        on_transition: Callable[[Transition], None] | None = None,
    ) -> None:
        view, padded = view or FieldOfView(), footprint.grown(options.padding_m)
        masks = load_masks(options.masks)
        self._planner = make_planner(options, padded)
        self._controller = make_controller(options, padded)
        lattice = LatticePlanner(options.lattice, options.traversal, padded)
        self._model = LocalModel(options.costmap, options.memory, padded, masks.keepout, view)
        self._path = PathManager(self._planner, options.route)
        self._follower = PathFollower(
            self._controller,
            PoseSequenceFollower(options.manoeuvre, options.limits, padded, lattice),
            FinalApproach(options.limits, padded, approach_m_s=options.approach_m_s),
            window_m=options.costmap.window_m,
        )
        self._speed_limiter = SpeedLimiter(
            options.limits, approach_m_s=options.approach_m_s, mask=masks.speed
        )
        self._filter = CommandFilter(
            limits=options.limits,
            monitor=options.monitor,
            dynamic_obstacles=options.traffic,
            footprint=footprint,
            padded=padded,
            drive=drive,
            view=view,
        )
        self._watchdog = MotionWatchdog(options.progress)
        self._make_recovery = partial(
            RecoveryPolicy,
            patience_s=options.patience_s,
            progress=options.progress,
            recovery=options.recovery,
            limits=options.limits,
            footprint=padded,
            planner=self._planner,
            controller=self._controller,
        )
        self._footprint, self._costmap_options = footprint, options.costmap
        self._active: ActiveGoal | None = None
        self._state, self._reason = NavigationState.IDLE, ""
        self._last_command = Twist2()
        self._last_s: float | None = None
        self._transitions = TransitionLog(on_transition)

    @property
    def state(self) -> NavigationState:
        """What the navigator is doing."""
        return self._state

    @property
    def transitions(self) -> tuple[Transition, ...]:
        """The newest changes of state, oldest first, each with its reason."""
        return tuple(self._transitions.entries)

    @property
    def costmap(self) -> Costmap | None:
        """The costmap of the newest cycle, for display and recording."""
        return self._model.costmap

    def validate_goal(self, goal: Goal, grid: OccupancyGrid) -> None:
        """Check that the planner could end a path at a goal. Raises ThumperError as `validate_goal` does."""
        validate_goal(goal, grid, self._footprint, self._planner, self._costmap_options)

    def set_goal(self, goal: Goal) -> None:
        """Start driving to a goal; replaces the current goal."""
        self._active = ActiveGoal(goal=goal, checker=GoalChecker(goal), recovery=self._make_recovery(goal))
        self._state, self._reason = NavigationState.NAVIGATING, ""
        self._path.clear()
        self._follower.reset()
        self._watchdog.reset()

    def cancel(self) -> None:
        """Drop the goal; the next command is zero."""
        self._active = None
        self._state, self._reason = NavigationState.IDLE, "cancelled"

    def update(
        self,
        time_s: float,
        map_from_base: Pose2,
        twist: Twist2,
        grid: OccupancyGrid,
        hits_in_map: FloatArray,
        *,
        lost: str = "",
    ) -> NavigationOutput:
        """Return the command for the next cycle.

        Parameters
        ----------
        time_s : float
            Time of the pose, on any steady clock [s].
        map_from_base, twist : Pose2, Twist2
            Pose and measured twist of the robot.
        grid : OccupancyGrid
            The map so far; the goal's cell may be unknown.
        hits_in_map : ndarray, shape (n, 2)
            End points of the newest scan's beams that hit something [m]; rows that are not finite are
            ignored.
        lost : str
            Why the pose is not trusted now; empty if it is.
        """
        try:
            output = self._update(time_s, map_from_base, twist, grid, hits_in_map, lost)
        except Exception as error:
            # In motion every error must stop the robot; an exception would leave the last command active.
            output = self._fail(f"internal error in navigation: {type(error).__name__}: {error}")
        self._last_command = output.command
        recovery = ""
        if self._active is not None and output.state is NavigationState.RECOVERING:
            recovery = self._active.recovery.recovery_name
        self._transitions.record(time_s, output.state.value, output.reason, recovery)
        return output

    def _update(
        self,
        time_s: float,
        map_from_base: Pose2,
        twist: Twist2,
        grid: OccupancyGrid,
        hits_in_map: FloatArray,
        lost: str,
    ) -> NavigationOutput:
        """Update the local model, plan, check the goal, control or recover, and filter the command."""
        period_s = self._elapsed_s(time_s)
        active = self._active
        if active is None or self._state in FINAL_STATES:
            return NavigationOutput(state=self._state, reason=self._reason)
        if stop := self._check_inputs(time_s, map_from_base, twist, lost):
            return self._fail(stop.reason) if stop.final else self._pause(active, stop.reason)

        costmap = self._model.update(time_s, map_from_base, grid, hits_in_map)
        self._filter.update(time_s, map_from_base, self._model.hits_m)
        active.recovery.update(time_s, self._model, grid, costmap)

        self._path.update(time_s, costmap, map_from_base, active.goal)
        request = self._control_request(map_from_base, twist, grid, period_s)

        active.checker.update(map_from_base)
        if self._is_reached(active, request):
            self._state, self._reason = NavigationState.REACHED, f"at the goal {active.goal}"
            return self._output(Twist2(), request)

        result: ControlResult | Stop
        if self._state is NavigationState.RECOVERING:
            result = self._recover(time_s, active, request)
        else:
            result = self._control(time_s, active, request)
        if isinstance(result, Stop):
            return self._fail(result.reason)
        return self._filtered(time_s, active, result, request)

    def _elapsed_s(self, time_s: float) -> float:
        """Return the time since the last cycle, within sensible limits [s]."""
        last_s, self._last_s = self._last_s, time_s
        if last_s is None:
            return USUAL_PERIOD_S
        return min(max(time_s - last_s, MIN_PERIOD_S), MAX_PERIOD_S)

    def _check_inputs(self, time_s: float, map_from_base: Pose2, twist: Twist2, lost: str) -> Stop | None:
        """Return why the robot must not drive on these inputs, or None."""
        numbers = (map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad, twist.v_m_s, twist.w_rad_s)
        if not np.isfinite(numbers).all():
            return Stop(reason="the robot's pose or speed is not a number", final=True)
        return self._watchdog.check(time_s, self._last_command, twist, lost)

    def _control_request(
        self, map_from_base: Pose2, twist: Twist2, grid: OccupancyGrid, period_s: float
    ) -> ControlRequest:
        path_m = self._path.path_m
        remaining_m = self._path.remaining_m(map_from_base)
        return ControlRequest(
            map_from_base=map_from_base,
            twist=twist,
            last_command=self._last_command,
            path_m=np.empty((0, 2)) if path_m is None else path_m,
            costmap=self._model.local_costmap(grid, map_from_base),
            v_limit_m_s=self._speed_limiter.limit_m_s(map_from_base, path_m, remaining_m),
            period_s=period_s,
        )

    def _is_reached(self, active: ActiveGoal, request: ControlRequest) -> bool:
        checker = active.checker
        return (
            checker.position_reached
            and is_still(request.twist)
            and checker.heading_reached(request.map_from_base)
        )

    def _control(self, time_s: float, active: ActiveGoal, request: ControlRequest) -> ControlResult | Stop:
        """Follow the path, rotate to the goal heading, or start a recovery."""
        base, checker = request.map_from_base, active.checker
        problem = active.recovery.check(
            time_s, request, self._path.remaining_m(base), self._reason, dead_end=self._follower.dead_end
        )
        if active.recovery.is_stationary(time_s):
            checker.accept_within_tolerance(base)
        if checker.position_reached:
            return self._rotate_to_heading(active.goal, request)
        if problem is not None:
            return self._start_recovery(time_s, active, request, problem)
        if self._path.path_m is None:
            return ControlResult(command=None, reason=self._path.reason)
        return self._follower.compute_command(time_s, request, active.goal)

    def _rotate_to_heading(self, goal: Goal, request: ControlRequest) -> ControlResult:
        error_rad = goal.heading_error_rad(request.map_from_base)
        if abs(error_rad) <= 0.5 * goal.heading_tolerance_rad:
            return ControlResult(command=Twist2())
        return self._controller.rotate(request, error_rad)

    def _start_recovery(
        self, time_s: float, active: ActiveGoal, request: ControlRequest, problem: str
    ) -> ControlResult | Stop:
        self._follower.reset()
        if stop := active.recovery.start_recovery(time_s, request, problem):
            return stop
        if (radius_m := active.recovery.forget_radius_m) is not None:
            self._model.forget_beyond(request.map_from_base, radius_m)
        self._state, self._reason = NavigationState.RECOVERING, active.recovery.current
        return self._recover(time_s, active, request)

    def _recover(self, time_s: float, active: ActiveGoal, request: ControlRequest) -> ControlResult:
        """Continue the recovery; drive on when it has ended."""
        command = active.recovery.compute_command(time_s, request)
        if command is not None:
            return ControlResult(command=command)
        self._state = NavigationState.NAVIGATING
        self._path.clear()
        self._follower.reset()
        return ControlResult(command=Twist2())

    def _filtered(
        self, time_s: float, active: ActiveGoal, result: ControlResult, request: ControlRequest
    ) -> NavigationOutput:
        """Pass the command through the command filter and update the state."""
        filtered = self._filter.filter(
            result,
            request,
            request.map_from_base.inverse().apply(self._model.obstacles_m),
            self._model.position_error_m,
            allow_escape=self._is_following(active, request),
        )
        if filtered.command is None:
            return self._rejected(time_s, active, filtered.reason, result, request)
        active.recovery.on_motion()
        if filtered.escaping:
            self._reason = filtered.reason
            return self._output(filtered.command, request)
        if filtered.yielding:
            self._reason = filtered.reason
        elif self._state is not NavigationState.RECOVERING:
            self._state = NavigationState.ROTATING if result.rotating else NavigationState.NAVIGATING
            self._reason = self._path.reason
        return self._output(filtered.command, request, result.trajectory)

    def _rejected(
        self, time_s: float, active: ActiveGoal, reason: str, result: ControlResult, request: ControlRequest
    ) -> NavigationOutput:
        """Stop; after a while start a recovery."""
        if active.recovery.on_rejected(time_s, request):
            started = self._start_recovery(time_s, active, request, reason)
            if isinstance(started, Stop):
                return self._fail(started.reason)
            reason = self._reason
        elif self._state is NavigationState.RECOVERING:
            reason = f"{active.recovery.current}; {reason}"
        self._reason = reason
        return self._output(Twist2(), request, result.trajectory)

    def _is_following(self, active: ActiveGoal, request: ControlRequest) -> bool:
        """Return whether the robot follows a path."""
        moving = self._state in (NavigationState.NAVIGATING, NavigationState.ROTATING)
        return moving and not active.checker.position_reached and len(request.path_m) > 0

    def _output(
        self, command: Twist2, request: ControlRequest, trajectory: FloatArray | None = None
    ) -> NavigationOutput:
        return NavigationOutput(
            command=command,
            state=self._state,
            reason=self._reason,
            plan=request.path_m,
            local_plan=np.empty((0, 3)) if trajectory is None else trajectory,
        )

    def _pause(self, active: ActiveGoal, reason: str) -> NavigationOutput:
        """Stop for now; follower and timers start again afterwards."""
        self._follower.reset()
        active.recovery.restart_timers()
        self._reason = reason
        return NavigationOutput(state=self._state, reason=reason)

    def _fail(self, reason: str) -> NavigationOutput:
        self._state, self._reason = NavigationState.FAILED, reason
        return NavigationOutput(state=self._state, reason=reason)
