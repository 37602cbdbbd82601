"""Recovery policy: when to start a recovery, which one, and when to give up."""

import math
from functools import partial

from thumper.common.geometry import Twist2
from thumper.navigation.controllers.controller import Controller, ControlRequest
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.local_model import LocalModel
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.goal_poses import goal_poses
from thumper.navigation.planners.goal_validation import footprint_fits
from thumper.navigation.planners.planner import Planner
from thumper.navigation.recovery.behaviors import RecoveryBehaviors, RecoveryOptions
from thumper.navigation.recovery.progress_checker import ProgressChecker, ProgressOptions
from thumper.navigation.recovery.reachability import Reachability
from thumper.navigation.speed_limits import SpeedLimits
from thumper.navigation.state import CycleInput, Stop

FIT_PERIOD_S = 1.0  # how long the check of the room at the goal is valid
UNREACHABLE_S = 0.5  # an unreachable goal without a path is given up, or observed again, after this time


class RecoveryPolicy:
    """Watches the drive to one goal; call `update` in each cycle."""

    def __init__(
        self,
        goal: Goal,
        *,
        patience_s: float,
        progress: ProgressOptions,
        recovery: RecoveryOptions,
        limits: SpeedLimits,
        footprint: Footprint,
        planner: Planner,
        controller: Controller,
    ) -> None:
        self._goal = goal
        self._patience_s = patience_s
        self._footprint = footprint
        self._progress = ProgressChecker(progress)
        self._behaviors = RecoveryBehaviors(recovery, limits, footprint, controller)
        self._reachability = Reachability(planner, footprint)
        self._costmap: Costmap | None = None
        self._beside_unseen = False
        self._rejected_since_s: float | None = None
        self._dead_end = False
        self._never_fits, self._fit_checked_s = False, -math.inf
        self.current = ""  # the newest recovery, with its cause

    def restart_timers(self) -> None:
        """Allow the full times again: the robot had to stop for a while."""
        self._progress.restart_timers()

    def update(self, cycle: CycleInput, model: LocalModel, costmap: Costmap) -> None:
        """Remember the space that is free now."""
        self._reachability.update(cycle.time_s, costmap, partial(model.static_band, cycle.grid))
        self._costmap = costmap
        self._beside_unseen = model.pose_costmap is not None

    @property
    def forget_radius_m(self) -> float | None:
        """The distance beyond which the new recovery forgets remembered points; None: it forgets none."""
        return self._behaviors.forget_radius_m

    @property
    def recovery_name(self) -> str:
        """The newest recovery."""
        return self._behaviors.name

    def check(
        self, time_s: float, request: ControlRequest, remaining_m: float, status: str, *, dead_end: bool
    ) -> str | None:
        """Return why the drive makes no progress, or None.

        `status` is the reason that is reported now. At a `dead_end` the whole footprint cannot continue.
        """
        progress = self._progress.update(time_s, request.map_from_base, remaining_m)
        if progress.nearer:
            self._behaviors.restart()
        if self._progress.is_hopeless(time_s):
            self._behaviors.abort()
            problem = f"no nearer to the goal for {self._progress.idle_time_s(time_s):.0f} s"
            return f"{problem}; {status}" if status else problem
        left_m = self._goal.distance_m(request.map_from_base)
        stationary = self.is_stationary(time_s)
        self._dead_end = stationary and dead_end
        is_close = stationary and left_m < self._goal.tolerance_m + self._footprint.circumscribed_radius_m
        if (self._dead_end or is_close) and self._can_never_fit(time_s, request):
            self._behaviors.abort()
        elif not self._dead_end:
            return progress.problem
        return f"no path for the whole footprint was found, {left_m:.2f} m from the goal {self._goal}"

    def is_stationary(self, time_s: float) -> bool:
        """Return whether the robot has not moved for longer than `patience_s`."""
        return self._progress.stationary_s(time_s) > self._patience_s

    def on_rejected(self, time_s: float, request: ControlRequest) -> bool:
        """Count a cycle without an allowed motion; return whether there have been too many."""
        self._rejected_since_s = time_s if self._rejected_since_s is None else self._rejected_since_s
        rejected_s = time_s - self._rejected_since_s
        return rejected_s > self._patience_s or (rejected_s > UNREACHABLE_S and self._is_unreachable(request))

    def on_motion(self) -> None:
        """Count a cycle with an allowed motion."""
        self._rejected_since_s = None

    def start_recovery(self, time_s: float, request: ControlRequest, problem: str) -> Stop | None:
        """Start the next recovery; return why the drive ends if there is none left."""
        self._rejected_since_s = None
        only_rotate = self._dead_end or self._is_unreachable(request)
        only_rotate = only_rotate or self._can_never_fit(time_s, request)
        if self._behaviors.start(time_s, request, only_rotate=only_rotate):
            self.current = f"{self._behaviors.name}, because {problem}"
            return None
        count = self._behaviors.attempts
        tried = f" after {count} {'recovery' if count == 1 else 'recoveries'}" if count else ""
        if self._costmap is not None and not footprint_fits(self._costmap, self._footprint, self._goal):
            problem += "; there is no room for the robot at the goal"
        if self._beside_unseen:
            problem += "; the robot does not turn or back up over the ground beside it that it has never seen"
        return Stop(reason=f"gave up{tried}: {problem}", final=True)

    def compute_command(self, time_s: float, request: ControlRequest) -> Twist2 | None:
        """Return the recovery's next twist, or None when it has ended."""
        command = self._behaviors.compute_command(time_s, request)
        if command is None:
            self._progress.restart_timers()
        return command

    def _is_unreachable(self, request: ControlRequest) -> bool:
        """Return whether there is no path and never was: then only observing again can help."""
        if self._costmap is None or len(request.path_m):
            return False
        return self._reachability.is_unreachable(self._costmap, request.map_from_base, self._goal)

    def _can_never_fit(self, time_s: float, request: ControlRequest) -> bool:
        """Return whether the goal never had room for the robot, and has none in the finer window.

        Looks at most once per `FIT_PERIOD_S`.
        """
        if time_s - self._fit_checked_s >= FIT_PERIOD_S:
            self._never_fits, self._fit_checked_s = self._has_no_room(request), time_s
        return self._never_fits

    def _has_no_room(self, request: ControlRequest) -> bool:
        if self._costmap is None:
            return False
        radius_m = self._goal.tolerance_m + self._footprint.circumscribed_radius_m
        around = self._reachability.optimistic_around(self._costmap, self._goal, radius_m)
        if footprint_fits(around, self._footprint, self._goal):
            return False
        costmap = request.fine_costmap() if request.fine_costmap else request.costmap
        return len(goal_poses(costmap, self._footprint, self._goal).poses) == 0
