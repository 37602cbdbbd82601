"""Drives the robot to a goal: costmap, plan, control, recovery, collision monitor; one `update` a cycle.

Pure: time and sensor data in, a twist out. Nothing raises out of `update`: an error is a stop with a reason.
"""

from collections.abc import Callable

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
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.planners.replanning import PathManager
from thumper.navigation.recovery.motion_watchdog import MotionWatchdog
from thumper.navigation.recovery.recovery_policy import RecoveryPolicy
from thumper.navigation.registry import make_controller, make_planner
from thumper.navigation.safety.command_filter import CommandFilter
from thumper.navigation.speed_limits import is_still
from thumper.navigation.state import NavigationOutput, NavigationState, Transition, TransitionLog

__all__ = ["NavigationOutput", "NavigationState", "Navigator"]

USUAL_PERIOD_S = 0.1


class Navigator:
    """One robot on its way to one goal.

    `on_transition` is told every change of state. Raises ThumperError, with exit code 2, for a name or a mask
    that is not there.
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
        self._guard = CommandFilter(
            options.limits, options.monitor, options.traffic, footprint, padded, drive, view
        )
        self._controller = make_controller(options, padded)
        planner = make_planner(options, padded)
        self._route = PathManager(planner, options.route)
        self._patience = RecoveryPolicy(
            options.patience_s,
            options.progress,
            options.recovery,
            options.limits,
            padded,
            planner,
            self._controller,
        )
        lattice = LatticePlanner(options.lattice, padded)
        self._follower = PathFollower(
            self._controller,
            PoseSequenceFollower(options.manoeuvre, options.limits, padded, lattice),
            FinalApproach(options.limits, padded, approach_m_s=options.approach_m_s),
            after_s=options.manoeuvre.after_s,
            window_m=options.costmap.window_m,
        )
        masks = load_masks(options.masks)
        self._surroundings = LocalModel(options.costmap, options.memory, padded, masks.keepout, view)
        self._speed_rule = SpeedLimiter(options.limits, approach_m_s=options.approach_m_s, mask=masks.speed)
        self._bearings = MotionWatchdog(options.progress)
        self._goal: Goal | None = None
        self._state, self._reason = NavigationState.IDLE, ""
        self._last_command = Twist2()
        self._last_s: float | None = None
        self._transitions = TransitionLog(on_transition)

    @property
    def state(self) -> NavigationState:
        """What it is doing."""
        return self._state

    @property
    def transitions(self) -> tuple[Transition, ...]:
        """The newest changes of state, oldest first, each with its reason."""
        return tuple(self._transitions.entries)

    @property
    def costmap(self) -> Costmap | None:
        """That of the newest cycle, for display and record."""
        return self._surroundings.costmap

    def set_goal(self, goal: Goal) -> None:
        """Begin the way to a goal; a goal under way is dropped."""
        self._goal = goal
        self._arrival = GoalChecker(goal)
        self._state, self._reason = NavigationState.NAVIGATING, ""
        self._route.clear()
        self._patience.begin(goal)
        self._follower.reset()
        self._bearings.reset()

    def cancel(self) -> None:
        """Give the goal up; the next command is zero."""
        self._goal = None
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
            Where the robot is and how it moves (measured).
        grid : OccupancyGrid
            The map so far; the goal's cell may be unknown.
        hits_in_map : ndarray, shape (n, 2)
            End points of the newest scan's beams that hit something [m]; rows that are not finite are
            ignored.
        lost : str
            Why the pose cannot be trusted just now, in words; empty when it can.
        """
        try:
            output = self._update(time_s, map_from_base, twist, grid, hits_in_map, lost)
        except Exception as error:
            # In motion every error is a stop with a reason; a traceback would leave the last command
            # standing.
            output = self._fail(f"internal error in navigation: {type(error).__name__}: {error}")
        self._last_command = output.command
        told = self._patience.recovery_name if output.state is NavigationState.RECOVERING else ""
        self._transitions.note(time_s, output.state.value, output.reason, told)
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
        period_s = USUAL_PERIOD_S if self._last_s is None else min(max(time_s - self._last_s, 0.02), 0.3)
        self._last_s = time_s
        goal = self._goal
        if goal is None or self._state in (NavigationState.REACHED, NavigationState.FAILED):
            return NavigationOutput(state=self._state, reason=self._reason)
        numbers = (map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad, twist.v_m_s, twist.w_rad_s)
        if not np.isfinite(numbers).all():
            return self._fail("the robot's pose or speed is not a number")
        objection, final = self._bearings.objection(time_s, self._last_command, twist, lost)
        if objection:
            return self._fail(objection) if final else self._stand(objection)

        around = self._surroundings
        costmap = around.update(time_s, map_from_base, grid, hits_in_map)
        self._guard.see(time_s, map_from_base, around.seen_m)
        self._patience.note(time_s, around, grid, costmap)
        self._route.update(time_s, costmap, map_from_base, goal)
        self._arrival.update(map_from_base)
        remaining_m = self._route.remaining_m(map_from_base)
        request = ControlRequest(
            map_from_base=map_from_base,
            twist=twist,
            last_command=self._last_command,
            path_m=np.empty((0, 2)) if self._route.path_m is None else self._route.path_m,
            costmap=around.window(grid, map_from_base),
            v_limit_m_s=self._speed_rule.limit_m_s(map_from_base, self._route.path_m, remaining_m),
            period_s=period_s,
        )
        if self._arrival.at_place and is_still(twist) and self._arrival.is_turned(map_from_base):
            self._state, self._reason = NavigationState.REACHED, f"at the goal {goal}"
            return self._output(Twist2(), request)

        if self._state is NavigationState.RECOVERING:
            result = self._recover(time_s, request)
        else:
            result = self._follow(time_s, request, goal, remaining_m)
        if self._has_failed():
            return self._fail(self._reason)
        return self._guarded(time_s, result, request)

    def _follow(
        self, time_s: float, request: ControlRequest, goal: Goal, remaining_m: float
    ) -> ControlResult:
        complaint = self._patience.complaint(
            time_s, request, remaining_m, self._reason, dead_end=self._follower.dead_end
        )
        if not self._arrival.at_place and self._patience.stands(time_s):
            # As near as it gets may be near enough.
            self._arrival.at_place = goal.distance_m(request.map_from_base) <= goal.tolerance_m
        if complaint and not self._arrival.at_place:
            return self._begin_recovery(time_s, request, complaint)
        if self._arrival.at_place:
            turn_rad = goal.heading_error_rad(request.map_from_base)
            turned = abs(turn_rad) <= 0.5 * goal.heading_tolerance_rad
            return ControlResult(command=Twist2()) if turned else self._controller.turn(request, turn_rad)
        if self._route.path_m is None:
            return ControlResult(command=None, reason=self._route.reason)
        return self._follower.step(time_s, request, goal)

    def _begin_recovery(self, time_s: float, request: ControlRequest, why: str) -> ControlResult:
        self._follower.reset()
        if over := self._patience.recover(time_s, request, why):
            self._state, self._reason = NavigationState.FAILED, over
            return ControlResult(command=None)
        if (radius_m := self._patience.forget_radius_m) is not None:
            self._surroundings.forget_beyond(request.map_from_base, radius_m)
        self._state, self._reason = NavigationState.RECOVERING, self._patience.doing
        return self._recover(time_s, request)

    def _recover(self, time_s: float, request: ControlRequest) -> ControlResult:
        command = self._patience.recovering(time_s, request)
        if command is not None:
            return ControlResult(command=command)
        self._state = NavigationState.NAVIGATING
        self._route.clear()
        self._follower.reset()
        return ControlResult(command=Twist2())

    def _guarded(self, time_s: float, result: ControlResult, request: ControlRequest) -> NavigationOutput:
        """Let the command through the last checks and keep the state and the patience."""
        around = self._surroundings
        verdict = self._guard.judge(
            result,
            request,
            request.map_from_base.inverse().apply(around.points_m),
            around.spread_m,
            may_free=self._is_on_the_way(request),
        )
        if verdict.command is None:
            return self._refused(time_s, verdict.reason, result, request)
        self._patience.moves()
        if verdict.frees_itself:
            self._reason = verdict.reason
            return self._output(verdict.command, request)
        if verdict.gives_way:
            self._reason = verdict.reason
        elif self._state is not NavigationState.RECOVERING:
            self._state = NavigationState.ROTATING if result.rotating else NavigationState.NAVIGATING
            self._reason = self._route.reason
        return self._output(verdict.command, request, result.trajectory)

    def _refused(
        self, time_s: float, reason: str, result: ControlResult, request: ControlRequest
    ) -> NavigationOutput:
        """Stand, and after a while try something else."""
        if self._patience.is_over(time_s, request):
            self._begin_recovery(time_s, request, reason)
            if self._has_failed():
                return self._fail(self._reason)
            reason = self._reason
        elif self._state is NavigationState.RECOVERING:
            reason = f"{self._patience.doing}; {reason}"
        self._reason = reason
        return self._output(Twist2(), request, result.trajectory)

    def _is_on_the_way(self, request: ControlRequest) -> bool:
        moving = self._state in (NavigationState.NAVIGATING, NavigationState.ROTATING)
        return moving and not self._arrival.at_place and len(request.path_m) > 0

    def _has_failed(self) -> bool:
        return self._state is NavigationState.FAILED

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

    def _stand(self, reason: str) -> NavigationOutput:
        """Stop for now; what was under way begins afresh afterwards."""
        self._follower.reset()
        self._patience.renew()
        self._reason = reason
        return NavigationOutput(state=self._state, reason=reason)

    def _fail(self, reason: str) -> NavigationOutput:
        self._state, self._reason = NavigationState.FAILED, reason
        return NavigationOutput(state=self._state, reason=reason)
