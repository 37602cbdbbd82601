"""Keeps the plan: replans when it must, changes its mind only when that pays."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import is_blocked
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.polyline import arc_lengths, nearest_index, nearest_place

TINY_M = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplanningOptions:
    """When to replan."""

    # Time between looks for a better path [s].
    period_s: Annotated[float, Gt(0)] = 1.0
    # Least time between two plans when the path is blocked [s].
    blocked_period_s: Annotated[float, Gt(0)] = 0.3
    # A new path must be cheaper by this part of the old one's cost; more holds on to a path longer.
    better_by: Annotated[float, Interval(ge=0, lt=1)] = 0.10
    # Distance from the path beyond which it is given up [m].
    stray_m: Annotated[float, Gt(0)] = 0.40
    # How long a blocked path is kept while no other is found [s]: one noisy scan must not stop the robot.
    grace_s: Annotated[float, Ge(0)] = 1.0


class PathManager:
    """The path being followed, from near the robot to the goal."""

    def __init__(self, planner: Planner, options: ReplanningOptions) -> None:
        self._planner = planner
        self._options = options
        self.clear()

    def clear(self) -> None:
        """Forget the path; the next `update` plans."""
        self.path_m: FloatArray | None = None
        self.reason = ""
        self._planned_s = -math.inf
        self._sound_s = -math.inf

    def update(self, time_s: float, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> None:
        """Bring `path_m`, shape (n, 2), and `reason` up to date; `path_m` is None when there is no way."""
        self._drop_passed(map_from_base)
        bad = self.path_m is None or self._is_unsound(self.path_m, costmap, map_from_base)
        if not bad:
            self._sound_s = time_s
        age_s = time_s - self._planned_s
        if age_s < (self._options.blocked_period_s if bad else self._options.period_s):
            return
        self._planned_s = time_s
        result = self._planner.plan(costmap, map_from_base, goal)
        if result.path_m is None:
            if bad and time_s - self._sound_s > self._options.grace_s:
                self.path_m, self.reason = None, result.reason
            return
        if self.path_m is None or bad or self._is_better(result.path_m, self.path_m, costmap, map_from_base):
            self.path_m, self.reason = result.path_m, result.reason
            self._sound_s = time_s

    def remaining_m(self, map_from_base: Pose2) -> float:
        """Way left to the end of the path [m]; inf without a path."""
        if self.path_m is None:
            return math.inf
        segment, along_m = nearest_place(self.path_m, map_from_base.x_m, map_from_base.y_m)
        begin, end = self.path_m[segment : segment + 2]
        place = begin + along_m * (end - begin) / max(math.dist(begin, end), TINY_M)
        joint_m = math.dist(place, (map_from_base.x_m, map_from_base.y_m))
        return joint_m + float(arc_lengths(self.path_m[segment:])[-1]) - along_m

    def _drop_passed(self, map_from_base: Pose2) -> None:
        if self.path_m is not None:
            start = nearest_index(self.path_m, map_from_base.x_m, map_from_base.y_m)
            self.path_m = self.path_m[min(start, len(self.path_m) - 2) :]

    def _is_unsound(self, path_m: FloatArray, costmap: Costmap, map_from_base: Pose2) -> bool:
        off_m = math.hypot(path_m[0, 0] - map_from_base.x_m, path_m[0, 1] - map_from_base.y_m)
        return off_m > self._options.stray_m or is_blocked(costmap, path_m[1:])

    def _is_better(self, new_m: FloatArray, old_m: FloatArray, costmap: Costmap, base: Pose2) -> bool:
        joined_m = np.vstack(((base.x_m, base.y_m), old_m))
        new_cost = self._planner.path_cost_m(costmap, new_m)
        old_cost = self._planner.path_cost_m(costmap, joined_m)
        return new_cost < (1.0 - self._options.better_by) * old_cost
