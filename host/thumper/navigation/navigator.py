"""Drive the robot to a goal: plan, control, recover, check the command; one `update` per cycle.

Pure: time and sensor data in, a twist out. `update` never raises: an error is a stop with a reason.
"""

from collections.abc import Callable

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.filters import CostmapFilters, Masks, is_kept_out, load_masks, with_keepout
from thumper.navigation.costmap.local_model import ObstaclePoints
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.options import NavigationOptions
from thumper.navigation.parts import ActiveGoal, NavigatorParts
from thumper.navigation.planners.goal_validation import validate_goal
from thumper.navigation.safety.command_filter import FilteredCommand
from thumper.navigation.state import (
    CycleInput,
    NavigationOutput,
    NavigationState,
    ScanFrames,
    Stop,
    Transition,
    TransitionLog,
)

__all__ = ["NavigationOutput", "NavigationState", "Navigator", "ScanFrames"]

USUAL_PERIOD_S = 0.1
MIN_PERIOD_S, MAX_PERIOD_S = 0.02, 0.3
FINAL_STATES = (NavigationState.REACHED, NavigationState.FAILED)


class Navigator:
    """Drives one robot to one goal at a time; calls `on_transition` at every change of state.

    Raises ThumperError, with exit code 2, for an unknown planner or controller and an unreadable mask.
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
        self._parts = NavigatorParts.build(options, footprint, drive, view or FieldOfView())
        self._parts.model.are_walking = self._parts.command_filter.are_walking
        self._footprint, self._costmap_options = footprint, options.costmap
        self._configured_filters = load_masks(options.masks)
        self._active: ActiveGoal | None = None
        self._state, self._reason = NavigationState.IDLE, ""
        self._last_command = Twist2()
        self._last_s: float | None = None
        self._transitions = TransitionLog(on_transition)
        self.set_filters(CostmapFilters())

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
        return self._parts.model.costmap

    @property
    def keepout(self) -> Masks:
        """The keep-out masks: those of the configuration and those of `set_filters`."""
        return self._filters.keepout

    def set_filters(self, filters: CostmapFilters) -> None:
        """Replace the masks beside those of the configuration; they act from the next cycle on.

        A goal under way that is in a keep-out zone now fails.
        """
        self._filters = self._configured_filters + filters
        self._parts.model.set_keepout(self._filters.keepout)
        self._parts.speed_limiter.masks = self._filters.speed
        if self._active is None or self._state in FINAL_STATES:
            return
        self._parts.path.clear()  # it may lead through a new zone
        try:
            self._refuse_kept_out(self._active.goal)
        except ThumperError as refusal:
            self._fail(str(refusal))

    def validate_goal(self, goal: Goal, grid: OccupancyGrid) -> None:
        """Check that the planner could end a path at a goal. Raises ThumperError as `validate_goal` does."""
        self._refuse_kept_out(goal)
        closed = with_keepout(grid, self._filters.keepout)
        validate_goal(goal, closed, self._footprint, self._parts.planner, self._costmap_options)

    def _refuse_kept_out(self, goal: Goal) -> None:
        if is_kept_out(self._filters.keepout, goal.x_m, goal.y_m):
            raise ThumperError(f"goal {goal} is in a keep-out zone: choose a goal outside it")

    def clear_costmaps(self, map_from_base: Pose2) -> None:
        """Forget remembered obstacles, except beside the robot out of the lidar's view, and plan again."""
        self._parts.model.forget_beyond(map_from_base, 0.0)
        self._parts.path.clear()

    @property
    def obstacles(self) -> ObstaclePoints:
        """The obstacles round the robot, in the map: of the newest scan, remembered, and unseen ground."""
        return self._parts.model.obstacles

    def observe(
        self,
        time_s: float,
        map_from_base: Pose2,
        grid: OccupancyGrid,
        hits_in_map: FloatArray,
        *,
        lost: str,
        frames: ScanFrames,
        parked: bool = False,
    ) -> None:
        """Bring `obstacles` and `costmap` up to date in a cycle without `update`, with its arguments.

        A `parked` robot remembers nothing: what passes beside it, out of the lidar's view, would stay.
        Never raises: after an error `obstacles` are the hits of the scan alone.
        """
        cycle = CycleInput(
            time_s=time_s,
            map_from_base=map_from_base,
            twist=Twist2(),
            grid=grid,
            hits_in_map_m=hits_in_map,
            scan_pose=frames.map_from_base,
            map_from_odom=frames.map_from_odom,
            lost=lost,
            period_s=USUAL_PERIOD_S,
        )
        try:
            if not parked:
                self._parts.model.observe(cycle)
            self._parts.model.refresh(cycle, parked=parked)
        except Exception as error:
            # An exception would end manual driving, too, and with it the way out.
            self._parts.model.see_only(hits_in_map)
            reason = f"internal error in navigation: {type(error).__name__}: {error}"
            self._transitions.record(time_s, self._state.value, reason, "")

    def set_goal(self, goal: Goal) -> None:
        """Start driving to a goal; replaces the current goal."""
        self._active = self._parts.activate(goal)
        self._state, self._reason = NavigationState.NAVIGATING, ""
        self._parts.path.start_goal()
        self._parts.follower.reset()
        self._parts.follower.goal_manoeuvre.reset()
        self._parts.watchdog.reset()

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
        frames: ScanFrames | None = None,
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
        frames : ScanFrames, optional
            Frames of that scan. None: taken at `map_from_base`, and the map never jumps.
        """
        scan_pose, map_from_odom = frames or ScanFrames(map_from_base, Pose2())
        cycle = CycleInput(
            time_s=time_s,
            map_from_base=map_from_base,
            twist=twist,
            grid=grid,
            hits_in_map_m=hits_in_map,
            scan_pose=scan_pose,
            map_from_odom=map_from_odom,
            lost=lost,
            period_s=self._elapsed_s(time_s),
        )
        try:
            output = self._update(cycle)
        except Exception as error:
            # In motion every error must stop the robot; an exception would leave the last command active.
            output = self._fail(f"internal error in navigation: {type(error).__name__}: {error}")
        self._last_command = output.command
        recovery = ""
        if self._active is not None and output.state is NavigationState.RECOVERING:
            recovery = self._active.recovery.recovery_name
        self._transitions.record(time_s, output.state.value, output.reason, recovery)
        return output

    def _update(self, cycle: CycleInput) -> NavigationOutput:
        """Update the local model, plan, check the goal, control or recover, and filter the command."""
        active = self._active
        if active is None or self._state in FINAL_STATES:
            return NavigationOutput(state=self._state, reason=self._reason)
        if stop := self._check_inputs(cycle):
            return self._fail(stop.reason) if stop.final else self._pause(active, stop.reason)

        costmap = self._parts.model.update(cycle)
        if costmap is None:
            return self._pause(active, "computing the costs of the whole map")
        self._parts.command_filter.update(cycle, self._parts.model)
        active.recovery.update(cycle, self._parts.model, costmap)

        window = self._parts.model.local_costmap
        # Noise hides and shows static obstacles; what moves is another obstacle in every cycle.
        self._parts.path.keeps = not self._parts.command_filter.sees_motion(cycle.time_s)
        self._parts.path.update(cycle.time_s, costmap, cycle.map_from_base, active.goal, window)
        request = self._control_request(cycle)

        manoeuvre = self._parts.follower.goal_manoeuvre
        if manoeuvre.arrived:
            active.checker.accept_within_tolerance(cycle.map_from_base)
        if not manoeuvre.active:
            active.checker.update(cycle.map_from_base)
        if active.checker.is_reached(cycle.map_from_base, cycle.twist):
            self._state, self._reason = NavigationState.REACHED, f"at the goal {active.goal}"
            if manoeuvre.place:
                away_m = active.goal.distance_m(cycle.map_from_base)
                self._reason = (
                    f"at the nearest pose with room for the robot, {away_m:.2f} m from the goal "
                    f"{active.goal}: {manoeuvre.place}"
                )
            return self._output(Twist2(), request)

        result: ControlResult | Stop
        if self._state is NavigationState.RECOVERING:
            result = self._recover(cycle.time_s, active, request)
        else:
            result = self._control(cycle.time_s, active, request)
        if isinstance(result, Stop):
            return self._fail(result.reason)
        return self._filtered(cycle.time_s, active, result, request)

    def _elapsed_s(self, time_s: float) -> float:
        """Return the time since the last cycle, within sensible limits [s]."""
        last_s, self._last_s = self._last_s, time_s
        if last_s is None:
            return USUAL_PERIOD_S
        return min(max(time_s - last_s, MIN_PERIOD_S), MAX_PERIOD_S)

    def _check_inputs(self, cycle: CycleInput) -> Stop | None:
        """Return why the robot must not drive on these inputs, or None."""
        base, twist = cycle.map_from_base, cycle.twist
        if not np.isfinite((base.x_m, base.y_m, base.theta_rad, twist.v_m_s, twist.w_rad_s)).all():
            return Stop(reason="the robot's pose or speed is not a number", final=True)
        return self._parts.watchdog.check(cycle.time_s, self._last_command, twist, cycle.lost)

    def _control_request(self, cycle: CycleInput) -> ControlRequest:
        path = self._parts.path
        remaining_m = path.remaining_m(cycle.map_from_base)
        local_costmap = self._parts.model.local_costmap
        assert local_costmap is not None  # the model was updated
        return ControlRequest(
            map_from_base=cycle.map_from_base,
            twist=cycle.twist,
            last_command=self._last_command,
            path_m=np.empty((0, 2)) if path.path_m is None else path.path_m,
            costmap=local_costmap,
            v_limit_m_s=self._parts.speed_limiter.limit_m_s(cycle.map_from_base, path.path_m, remaining_m),
            period_s=cycle.period_s,
            pose_costmap=self._parts.model.pose_costmap,
            fine_costmap=self._parts.model.fine_costmap,
            move_ahead_m=self._parts.model.move_ahead_m,
        )

    def _control(self, time_s: float, active: ActiveGoal, request: ControlRequest) -> ControlResult | Stop:
        """Follow the path, rotate to the goal heading, or start a recovery."""
        base, checker, path = request.map_from_base, active.checker, self._parts.path
        problem = active.recovery.check(
            time_s, request, path.remaining_m(base), self._reason, dead_end=self._parts.follower.dead_end
        )
        manoeuvre = self._parts.follower.goal_manoeuvre
        if active.recovery.is_stationary(time_s) and not manoeuvre.active:
            checker.accept_within_tolerance(base)
        if checker.position_reached:
            return self._parts.follower.rotate_to_heading(request, active.goal)
        if problem is not None:
            return self._start_recovery(time_s, active, request, problem)
        if path.is_first_search:
            active.recovery.restart_timers()
            return ControlResult(command=Twist2())
        if path.path_m is None:
            return ControlResult(command=None, reason=path.reason)
        return self._parts.follower.compute_command(time_s, request, active.goal, checker.stop_goal(base))

    def _start_recovery(
        self, time_s: float, active: ActiveGoal, request: ControlRequest, problem: str
    ) -> ControlResult | Stop:
        self._parts.follower.reset()
        if stop := active.recovery.start_recovery(time_s, request, problem):
            return stop
        if (radius_m := active.recovery.forget_radius_m) is not None:
            self._parts.model.forget_beyond(request.map_from_base, radius_m)
        self._state, self._reason = NavigationState.RECOVERING, active.recovery.current
        return self._recover(time_s, active, request)

    def _recover(self, time_s: float, active: ActiveGoal, request: ControlRequest) -> ControlResult:
        """Continue the recovery; drive on when it has ended."""
        command = active.recovery.compute_command(time_s, request)
        if command is not None:
            return ControlResult(command=command)
        self._state = NavigationState.NAVIGATING
        self._parts.path.clear()
        self._parts.follower.reset()
        return ControlResult(command=Twist2())

    def _filtered(
        self, time_s: float, active: ActiveGoal, result: ControlResult, request: ControlRequest
    ) -> NavigationOutput:
        """Pass the command through the command filter and update the state."""
        recovering = self._state is NavigationState.RECOVERING
        follows = not recovering and not active.checker.position_reached and len(request.path_m) > 0
        follows &= not self._parts.follower.goal_manoeuvre.active  # it plans again, from where it is
        filtered = self._parts.command_filter.filter(result, request, allow_escape=follows)
        if filtered.command is None:
            return self._rejected(time_s, active, filtered, result, request)
        active.recovery.on_motion()
        if filtered.escaping:
            self._reason = filtered.reason
            return self._output(filtered.command, request)
        if filtered.yielding:
            self._reason = filtered.reason
            self._parts.follower.goal_manoeuvre.on_yielding()
        elif self._state is not NavigationState.RECOVERING:
            self._state = NavigationState.ROTATING if result.rotating else NavigationState.NAVIGATING
            manoeuvre, self._reason = self._parts.follower.goal_manoeuvre, self._parts.path.reason
            if manoeuvre.active and manoeuvre.place:
                self._reason = f"no room at the goal {active.goal}: going to {manoeuvre.place}"
        return self._output(filtered.command, request, result.trajectory)

    def _rejected(
        self,
        time_s: float,
        active: ActiveGoal,
        filtered: FilteredCommand,
        result: ControlResult,
        request: ControlRequest,
    ) -> NavigationOutput:
        """Stop; after a while start a recovery."""
        reason = filtered.reason
        if active.recovery.on_rejected(time_s, request):
            started = self._start_recovery(time_s, active, request, reason)
            if isinstance(started, Stop):
                return self._fail(started.reason)
            reason = self._reason
        elif self._state is NavigationState.RECOVERING:
            reason = f"{active.recovery.current}; {reason}"
        self._reason = reason
        return self._output(filtered.slowing, request, result.trajectory)

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
        self._parts.follower.reset()
        active.recovery.restart_timers()
        self._reason = reason
        return NavigationOutput(state=self._state, reason=reason)

    def _fail(self, reason: str) -> NavigationOutput:
        self._state, self._reason = NavigationState.FAILED, reason
        return NavigationOutput(state=self._state, reason=reason)
