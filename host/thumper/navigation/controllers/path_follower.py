"""Follows the path: by the controller, finely where its end is missed, by a manoeuvre where that stands."""

import math

import numpy as np

from thumper.navigation.controllers.controller import Controller, ControlRequest, ControlResult
from thumper.navigation.controllers.final_approach import FinalApproach
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower
from thumper.navigation.goal import Goal
from thumper.navigation.speed_limits import is_still

SAME_M = 0.03  # a path that ends this near to the goal leads there
LOCAL_GOAL_PART = 0.35  # of the window's side: as far as a manoeuvre is planned


class PathFollower:
    """A controller with a manoeuvre in reserve."""

    def __init__(
        self,
        controller: Controller,
        manoeuvre: PoseSequenceFollower,
        fine: FinalApproach,
        *,
        after_s: float,
        window_m: float,
    ) -> None:
        self._controller = controller
        self._manoeuvre = manoeuvre
        self._fine = fine
        self._after_s = after_s
        self._reach_m = LOCAL_GOAL_PART * window_m
        self._standing_since_s: float | None = None
        self.dead_end = False  # the path's end is near, but not for the whole outline
        self._at_end = self._has_parked = False  # a manoeuvre leads to the path's end; has led there

    def reset(self) -> None:
        """Forget the past, for a new goal."""
        self._controller.reset()
        self._manoeuvre.drop()
        self._fine.reset()
        self._standing_since_s = None
        self.dead_end = self._at_end = self._has_parked = False

    def step(self, time_s: float, request: ControlRequest, goal: Goal) -> ControlResult:
        """Return the next twist along the request's path, which must not be empty."""
        if self._manoeuvre.active:
            threaded = self._manoeuvre.step(request)
            if threaded is not None:
                return threaded
            self._has_parked |= self._at_end and self._manoeuvre.is_whole
        result = self._fine.step(request, goal) or self._controller.command(request)
        if result.command is not None and not is_still(result.command):
            self._standing_since_s, self.dead_end = None, False
        elif self._standing_since_s is None:
            self._standing_since_s = time_s
        elif time_s - self._standing_since_s > self._after_s:
            self._standing_since_s = None
            target, self._at_end = self._local_goal(request, goal)
            is_new = not (self._at_end and self._has_parked)  # what led no nearer leads no nearer again
            found = is_new and self._manoeuvre.begin(request, target, through=not self._at_end)
            self.dead_end = self._at_end and not found
            if found:
                return self._manoeuvre.step(request) or result
        return result

    def _local_goal(self, request: ControlRequest, goal: Goal) -> tuple[Goal, bool]:
        """The furthest point of the path that a manoeuvre shall reach, and whether that is the path's end.

        Where the goal itself cannot be entered the path ends at another place within its tolerance.
        """
        away_m = np.hypot(*(request.path_m - (request.map_from_base.x_m, request.map_from_base.y_m)).T)
        beyond = np.nonzero(away_m > self._reach_m)[0]
        if beyond.size:
            x_m, y_m = request.path_m[beyond[0]]
            return Goal(x_m=float(x_m), y_m=float(y_m), tolerance_m=0.15), False
        x_m, y_m = request.path_m[-1]
        off_m = math.dist((x_m, y_m), (goal.x_m, goal.y_m))
        if off_m <= SAME_M:
            return goal, True
        return Goal(x_m=float(x_m), y_m=float(y_m), tolerance_m=max(SAME_M, goal.tolerance_m - off_m)), True
