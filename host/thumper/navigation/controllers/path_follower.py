"""Follow the path: with the controller, near a missed goal straight, in a tight passage pose by pose."""

import math

import numpy as np

from thumper.common.geometry import Twist2
from thumper.navigation.controllers.controller import Controller, ControlRequest, ControlResult
from thumper.navigation.controllers.final_approach import FinalApproach
from thumper.navigation.controllers.goal_manoeuvre import GoalManoeuvre
from thumper.navigation.controllers.move_ahead import MoveAhead
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower
from thumper.navigation.goal import Goal
from thumper.navigation.speed_limits import is_still

SAME_PLACE_M = 0.03  # a path that ends this near to the goal leads there
LOCAL_GOAL_FRACTION = 0.35  # of the window's side: how far ahead poses are planned
LOCAL_TOLERANCE_M = 0.15
STATIONARY_S = 0.8  # time that the controller stops on a path before poses are planned


class PathFollower:
    """A controller, and a pose sequence follower for where the controller stops."""

    def __init__(
        self,
        controller: Controller,
        pose_follower: PoseSequenceFollower,
        final_approach: FinalApproach,
        move_ahead: MoveAhead,
        goal_manoeuvre: GoalManoeuvre,
        *,
        window_m: float,
    ) -> None:
        self._controller = controller
        self._pose_follower = pose_follower
        self._final_approach = final_approach
        self._move_ahead = move_ahead
        self.goal_manoeuvre = goal_manoeuvre
        self._local_goal_m = LOCAL_GOAL_FRACTION * window_m
        self._stationary_since_s: float | None = None
        self.dead_end = False  # the path's end is near, but the footprint cannot get there
        self._to_path_end = False  # the poses lead to the path's end
        self._was_at_path_end = False  # they have led there before

    def reset(self) -> None:
        """Forget the past, for a new goal."""
        self._controller.reset()
        self._pose_follower.stop()
        self._final_approach.reset()
        self.goal_manoeuvre.stop()
        self._stationary_since_s = None
        self.dead_end = self._to_path_end = self._was_at_path_end = False

    def compute_command(
        self, time_s: float, request: ControlRequest, goal: Goal, stop_goal: Goal | None = None
    ) -> ControlResult:
        """Return the next twist along the request's path, which must not be empty.

        `stop_goal` is where to stop instead of at the goal, once the robot is near; None for the goal.
        """
        if not self._pose_follower.is_planning and not self._pose_follower.active:
            move = None if self.goal_manoeuvre.active else self._move_ahead.compute_command(request)
            result = move or self.goal_manoeuvre.compute_command(request, goal)
            if result is not None:
                self._stationary_since_s = None
                return result
        if self._pose_follower.is_planning:
            return self._plan_on(request) or ControlResult(command=Twist2())
        if self._pose_follower.active:
            result = self._pose_follower.compute_command(request)
            if result is not None:
                return result
            self._was_at_path_end |= self._to_path_end and self._pose_follower.reaches_goal
        result = self._final_approach.compute_command(
            request, stop_goal or goal, missed=stop_goal is not None
        ) or self._controller.compute_command(request)
        if result.command is not None and not is_still(result.command):
            self._stationary_since_s, self.dead_end = None, False
        elif self._stationary_since_s is None:
            self._stationary_since_s = time_s
        elif time_s - self._stationary_since_s > STATIONARY_S:
            self._stationary_since_s = None
            self._plan_poses(request, goal)
            return self._plan_on(request) or result
        return result

    def rotate_to_heading(self, request: ControlRequest, goal: Goal) -> ControlResult:
        """Return the next twist of the rotation to the goal's heading."""
        error_rad = goal.heading_error_rad(request.map_from_base)
        if abs(error_rad) <= 0.5 * goal.heading_tolerance_rad:
            return ControlResult(command=Twist2())
        return self._controller.rotate(request, error_rad)

    def _plan_poses(self, request: ControlRequest, goal: Goal) -> None:
        """Begin to plan poses along the path, unless the same ones have led no further."""
        target, self._to_path_end = self._local_goal(request, goal)
        if self._to_path_end and self._was_at_path_end:
            self.dead_end = True
        else:
            self._pose_follower.plan(request, target, passage_only=not self._to_path_end)

    def _plan_on(self, request: ControlRequest) -> ControlResult | None:
        """Plan on; return the first command along the poses, or None if there is none yet."""
        if not self._pose_follower.is_planning:
            return None
        started = self._pose_follower.advance()
        if started is not None:
            self.dead_end = self._to_path_end and not started
        return self._pose_follower.compute_command(request) if started else None

    def _local_goal(self, request: ControlRequest, goal: Goal) -> tuple[Goal, bool]:
        """Return the furthest point of the path to plan poses to, and whether it is the path's end.

        If the goal itself cannot be entered, the path ends at another place within its tolerance.
        """
        distances_m = np.hypot(*(request.path_m - (request.map_from_base.x_m, request.map_from_base.y_m)).T)
        beyond = np.nonzero(distances_m > self._local_goal_m)[0]
        if beyond.size:
            x_m, y_m = request.path_m[beyond[0]]
            return Goal(x_m=float(x_m), y_m=float(y_m), tolerance_m=LOCAL_TOLERANCE_M), False
        x_m, y_m = request.path_m[-1]
        offset_m = math.dist((x_m, y_m), (goal.x_m, goal.y_m))
        if offset_m <= SAME_PLACE_M:
            return goal, True
        tolerance_m = max(SAME_PLACE_M, goal.tolerance_m - offset_m)
        return Goal(x_m=float(x_m), y_m=float(y_m), tolerance_m=tolerance_m), True
