"""Replan when necessary, and switch to another path only if it is clearly cheaper."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import SlicedSearch
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import is_blocked
from thumper.navigation.planners.planner import Planner, PlanResult
from thumper.navigation.planners.polyline import arc_lengths, nearest_vertex, project_onto

TINY_M = 1e-9
BLOCKED_PERIOD_S = 0.3  # least time between two plans while the path is blocked
MAX_PATH_DISTANCE_M = 0.40  # a robot further from its path than this needs a new one
# A blocked path is kept this long while there is no other: one noisy scan must not stop the robot.
BLOCKED_GRACE_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplanningOptions:
    """When to replan."""

    # Time between searches for a cheaper path [s].
    period_s: Annotated[float, Gt(0)] = 1.0
    # A new path must be cheaper by this fraction of the old one's cost; more keeps a path longer.
    better_by: Annotated[float, Interval(ge=0, lt=1)] = 0.10


class PathManager:
    """The path being followed, from near the robot to the goal."""

    def __init__(self, planner: Planner, options: ReplanningOptions) -> None:
        self._planner = planner
        self._options = options
        self.path_m: FloatArray | None = None  # shape (n, 2)
        self.reason = ""  # why there is no path, or where it ends if not at the goal
        self._search = SlicedSearch[PlanResult]()  # of a new path; takes several cycles in a large map
        self._planned_s = self._valid_s = -math.inf

    def clear(self) -> None:
        """Forget the path; the next `update` plans."""
        self.path_m, self.reason = None, ""
        self._planned_s = self._valid_s = -math.inf
        self._search.stop()

    def update(self, time_s: float, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> None:
        """Bring `path_m`, shape (n, 2), and `reason` up to date; `path_m` is None if there is no path."""
        if self.path_m is not None:
            self.path_m = _pruned(self.path_m, map_from_base)
        invalid = self.path_m is None or self._is_invalid(self.path_m, costmap, map_from_base)
        if not invalid:
            self._valid_s = time_s
        goes_on = self._search.is_running
        if not goes_on:
            age_s = time_s - self._planned_s
            if age_s < (BLOCKED_PERIOD_S if invalid else self._options.period_s):
                return
            self._planned_s = time_s
            self._search.start(self._planner.search(costmap, map_from_base, goal))
        result = self._search.advance()
        if result is None:
            return
        if result.path_m is None:
            if invalid and time_s - self._valid_s > BLOCKED_GRACE_S:
                self.path_m, self.reason = None, result.reason
            return
        new_m = result.path_m
        if goes_on:  # the world has changed since the search began
            new_m = _pruned(new_m, map_from_base)
            if self._is_invalid(new_m, costmap, map_from_base):
                self._planned_s = -math.inf
                return
        if self.path_m is None or invalid or self._is_cheaper(new_m, self.path_m, costmap, map_from_base):
            self.path_m, self.reason = new_m, result.reason
            self._valid_s = time_s

    def remaining_m(self, map_from_base: Pose2) -> float:
        """Return the distance left to the end of the path [m]; inf without a path."""
        if self.path_m is None:
            return math.inf
        segment, along_m = project_onto(self.path_m, map_from_base.x_m, map_from_base.y_m)
        begin, end = self.path_m[segment : segment + 2]
        nearest = begin + along_m * (end - begin) / max(math.dist(begin, end), TINY_M)
        offset_m = math.dist(nearest, (map_from_base.x_m, map_from_base.y_m))
        return offset_m + float(arc_lengths(self.path_m[segment:])[-1]) - along_m

    @property
    def is_first_search(self) -> bool:
        """Whether the first search for a path goes on: there is none yet, and no reason why."""
        return self.path_m is None and not self.reason and self._search.is_running

    def _is_invalid(self, path_m: FloatArray, costmap: Costmap, map_from_base: Pose2) -> bool:
        distance_m = math.hypot(path_m[0, 0] - map_from_base.x_m, path_m[0, 1] - map_from_base.y_m)
        return distance_m > MAX_PATH_DISTANCE_M or is_blocked(costmap, path_m[1:])

    def _is_cheaper(self, new_m: FloatArray, old_m: FloatArray, costmap: Costmap, base: Pose2) -> bool:
        joined_m = np.vstack(((base.x_m, base.y_m), old_m))
        new_cost = self._planner.path_cost_m(costmap, new_m)
        old_cost = self._planner.path_cost_m(costmap, joined_m)
        return new_cost < (1.0 - self._options.better_by) * old_cost


def _pruned(path_m: FloatArray, map_from_base: Pose2) -> FloatArray:
    """Return a path without the part that the robot has passed."""
    start = nearest_vertex(path_m, map_from_base.x_m, map_from_base.y_m)
    return path_m[min(start, len(path_m) - 2) :]
