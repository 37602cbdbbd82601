"""A drive that gets nowhere: whether to try something else, what that is, and when it is at its end."""

import numpy as np

from thumper.common.geometry import Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import Controller, ControlRequest
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.local_model import LocalModel
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.goal_validation import has_room
from thumper.navigation.planners.planner import Planner
from thumper.navigation.recovery.behaviors import RecoveryBehaviors, RecoveryOptions
from thumper.navigation.recovery.progress_checker import ProgressChecker, ProgressOptions
from thumper.navigation.recovery.reachability import Reachability
from thumper.navigation.speed_limits import SpeedLimits

CLOSED_S = 0.5  # without a way, where none can be hoped for, before it looks round or gives up


class RecoveryPolicy:
    """Watches one drive at a time: `begin`, then `note` in each cycle."""

    def __init__(
        self,
        patience_s: float,
        progress: ProgressOptions,
        recovery: RecoveryOptions,
        limits: SpeedLimits,
        footprint: Footprint,
        planner: Planner,
        controller: Controller,
    ) -> None:
        self._patience_s = patience_s
        self._footprint = footprint
        self._progress = ProgressChecker(progress)
        self._recovery = RecoveryBehaviors(recovery, limits, footprint, controller)
        self._prospects = Reachability(planner, footprint)
        self._costmap: Costmap | None = None

    def begin(self, goal: Goal) -> None:
        """Start afresh, for a new goal."""
        self._goal = goal
        self._progress.reset()
        self._recovery.reset()
        self._prospects.reset()
        self._refused_since_s: float | None = None
        self._dead_end = False

    def renew(self) -> None:
        """Grant the full times again: the robot had to stand for a while."""
        self._progress.renew()

    def note(self, time_s: float, around: LocalModel, grid: OccupancyGrid, costmap: Costmap) -> None:
        """Keep in mind what is open now."""
        if self._prospects.are_unasked:
            self._prospects.note(-np.inf, around.map_alone(grid))
        self._prospects.note(time_s, costmap)
        self._costmap = costmap

    @property
    def doing(self) -> str:
        """The recovery under way, with its cause."""
        return self._recovery.why

    @property
    def forget_radius_m(self) -> float | None:
        """Beyond which the recovery that has just begun forgets what is only remembered; None: nothing."""
        return self._recovery.forget_radius_m

    @property
    def recovery_name(self) -> str:
        """The recovery under way."""
        return self._recovery.name

    def complaint(
        self, time_s: float, request: ControlRequest, remaining_m: float, told: str, *, dead_end: bool
    ) -> str:
        """Why the drive gets nowhere, or an empty string.

        `told` is what is said of it now; a `dead_end` is one before which the whole outline cannot go on.
        """
        complaint, nearer = self._progress.update(time_s, request.map_from_base, remaining_m)
        if nearer:
            self._recovery.reset()
        if self._progress.is_hopeless(time_s):
            self._recovery.give_up()
            why = f"no nearer to the goal for {self._progress.idle_for_s(time_s):.0f} s"
            return f"{why}; {told}" if told else why
        left_m = self._goal.distance_m(request.map_from_base)
        stands = self.stands(time_s)
        self._dead_end = stands and dead_end
        is_before_it = stands and left_m < self._goal.tolerance_m + self._footprint.circumscribed_radius_m
        if (self._dead_end or is_before_it) and self._can_never_fit():
            self._recovery.give_up()
        elif not self._dead_end:
            return complaint
        return f"no way on was found for the whole outline, {left_m:.2f} m from the goal {self._goal}"

    def stands(self, time_s: float) -> bool:
        """Whether the robot is where it was some time ago."""
        return self._progress.standing_s(time_s) > self._patience_s

    def is_over(self, time_s: float, request: ControlRequest) -> bool:
        """Whether no motion or path was allowed for too long; to be asked in each cycle in which none is."""
        self._refused_since_s = time_s if self._refused_since_s is None else self._refused_since_s
        refused_s = time_s - self._refused_since_s
        return refused_s > self._patience_s or (refused_s > CLOSED_S and self._is_closed(request))

    def moves(self) -> None:
        """A motion was allowed."""
        self._refused_since_s = None

    def recover(self, time_s: float, request: ControlRequest, why: str) -> str:
        """Begin the next recovery; returns why the drive is over instead, or an empty string."""
        self._refused_since_s = None
        only_look = self._dead_end or self._is_closed(request) or self._can_never_fit()
        if self._recovery.start(time_s, request, only_look=only_look):
            self._recovery.why = f"{self._recovery.name}, because {why}"
            return ""
        count = self._recovery.attempts
        tried = f" after {count} {'recovery' if count == 1 else 'recoveries'}" if count else ""
        if self._costmap is not None and not has_room(self._costmap, self._footprint, self._goal):
            why += "; there is no room for the robot at the goal"
        return f"gave up{tried}: {why}"

    def recovering(self, time_s: float, request: ControlRequest) -> Twist2 | None:
        """The recovery's next twist, or None when it is over."""
        command = self._recovery.step(time_s, request)
        if command is None:
            self._progress.renew()
        return command

    def _is_closed(self, request: ControlRequest) -> bool:
        """Whether there is no way and none was ever seen open: then nothing but a look round can help."""
        if self._costmap is None or len(request.path_m):
            return False
        return self._prospects.are_none(self._costmap, request.map_from_base, self._goal)

    def _can_never_fit(self) -> bool:
        """Whether the goal was never seen with room for the robot."""
        if self._costmap is None:
            return False
        return not has_room(self._prospects.at_best(self._costmap), self._footprint, self._goal)
