"""Replan when necessary, and switch to another path only if it is clearly cheaper."""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.resumable import Search, SlicedSearch
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import INSCRIBED, MOST_INFLATED
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import is_blocked, is_off
from thumper.navigation.planners.homotopy import is_same_side
from thumper.navigation.planners.planner import Planner, PlanResult
from thumper.navigation.planners.polyline import arc_lengths, nearest_vertex, project_onto

TINY_M, TINY_S = 1e-9, 1e-6
BLOCKED_PERIOD_S = 0.3  # least time between two plans while the path is blocked
# A path blocked for less is kept: noise closes and opens a cell from scan to scan. In a gap that may only
# look too narrow, the controller gets more time.
BLOCKED_S, NARROW_S = 0.5, 2.0
SURE_FRACTION = 0.5  # an obstacle nearer to the path than this part of the inscribed radius surely blocks it
# So many searches in a row must find a cheaper path on another side before it replaces the kept one. Each
# change of side on the way to a goal doubles it: a doorway that looks free only from afar must not send the
# robot back and forth.
CHEAPER_SEARCHES, MAX_DOUBLINGS = 3, 6
HALF_CELL = 0.5  # an obstacle is up to this far from the middle of its cell
MAX_CURVE_RAD = 0.25 * math.pi  # a path that begins further to the side needs a turn on the spot
MAX_PATH_DISTANCE_M = 0.40  # a robot further from its path than this needs a new one
# A blocked path is kept this long while there is no other: one noisy scan must not stop the robot.
BLOCKED_GRACE_S = 1.0
# While something moves, a blocked path is kept for as long as the detour would take at this speed, at most
# MAX_KEPT_S.
DETOUR_PACE_M_S, MAX_KEPT_S = 0.4, 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplanningOptions:
    """When to replan."""

    # Time between searches for a cheaper path [s].
    period_s: Annotated[float, Gt(0)] = 1.0
    # A new path must be cheaper by this fraction of the old one's cost; more keeps a path longer.
    better_by: Annotated[float, Interval(ge=0, lt=1)] = 0.10


class Blockage(Enum):
    """Whether obstacles block a path."""

    NONE = "none"
    NARROW = "narrow"  # the robot may fit
    SURE = "sure"


class PathManager:
    """The path being followed, from near the robot to the goal."""

    def __init__(self, planner: Planner, options: ReplanningOptions, footprint: Footprint) -> None:
        """`footprint` is the one of planning, padding included."""
        self._planner = planner
        self._options = options
        self._inscribed_m = footprint.inscribed_radius_m
        self._circumscribed_m = footprint.circumscribed_radius_m
        self.path_m: FloatArray | None = None  # shape (n, 2)
        # Why there is no path, or where it ends if not at the goal. After `clear`, why there was none.
        self.reason = ""
        self.keeps = True  # a path for some time; False: something moves, a clearly cheaper path replaces it
        self._search = SlicedSearch[PlanResult]()  # of a new path; takes several cycles in a large map
        self._is_searched = False  # since it was cleared: `reason` is that of now
        self._planned_s = self._valid_s = self._open_s = -math.inf
        self._cheaper_count = 0  # searches in a row that found a clearly cheaper path
        self._side_changes = 0  # on the way to this goal

    def start_goal(self) -> None:
        """Forget the path to the last goal, and how often it changed."""
        self.clear()
        self.reason, self._side_changes = "", 0

    def clear(self) -> None:
        """Forget the path, but not why there was none; the next `update` plans."""
        if self.path_m is not None:
            self.reason = ""
        self.path_m, self._is_searched = None, False
        self._planned_s = self._valid_s = self._open_s = -math.inf
        self._cheaper_count = 0
        self._search.stop()

    def update(
        self,
        time_s: float,
        costmap: Costmap,
        map_from_base: Pose2,
        goal: Goal,
        window: Costmap | None = None,
    ) -> None:
        """Bring `path_m`, shape (n, 2), and `reason` up to date; `path_m` is None if there is no path.

        `window` has the finer costs round the robot, which decide whether the kept path is blocked there.
        """
        if self.path_m is not None:
            self.path_m = _pruned(self.path_m, map_from_base)
        invalid = self._is_given_up(time_s, costmap, map_from_base, window)
        goes_on = self._search.is_running
        if not goes_on:
            age_s = time_s - self._planned_s
            if age_s < (BLOCKED_PERIOD_S if invalid else self._options.period_s):
                return
            self._planned_s = time_s
            self._search.start(self._search_path(costmap, map_from_base, goal))
        result = self._search.advance()
        if result is None:
            return
        if result.path_m is None:
            self._cheaper_count = 0
            if invalid and time_s - self._valid_s > BLOCKED_GRACE_S:
                self.path_m, self.reason, self._is_searched = None, result.reason, True
            return
        new_m = result.path_m
        if goes_on:  # the world has changed since the search began
            new_m = _pruned(new_m, map_from_base)
            if (
                self._is_left(new_m, map_from_base)
                or self._blockage(new_m, costmap, map_from_base, window) is Blockage.SURE
            ):
                self._planned_s = -math.inf
                return
        if invalid:
            is_taken = self._is_worth_the_detour(new_m, time_s, map_from_base)
        else:
            is_taken = self._is_better(new_m, costmap, map_from_base)
        if is_taken:
            if self.path_m is not None and not is_same_side(new_m, self._joined(map_from_base), costmap):
                self._side_changes += 1
            self.path_m, self.reason, self._is_searched = new_m, result.reason, True
            self._valid_s = self._open_s = time_s
            self._cheaper_count = 0

    def _search_path(self, costmap: Costmap, base: Pose2, goal: Goal) -> Search[PlanResult]:
        """Search a path; if there is none, one through gaps that may only look too narrow in coarse cells."""
        result = yield from self._planner.search(costmap, base, goal)
        if not result.unreachable:
            return result
        least_cells = self._inscribed_m / costmap.resolution_m - HALF_CELL
        narrow = (costmap.costs == INSCRIBED) & (costmap.squared_cells > max(0.0, least_cells) ** 2)
        costs = costmap.costs.copy()
        costs[narrow] = MOST_INFLATED
        second = yield from self._planner.search(replace(costmap, costs=costs), base, goal)
        return result if second.path_m is None else second

    def _is_given_up(self, time_s: float, costmap: Costmap, base: Pose2, window: Costmap | None) -> bool:
        """Return whether there is no path, or another must replace it: it is left, or blocked for long."""
        if self.path_m is None or self._is_left(self.path_m, base):
            return True
        if not self.keeps and is_blocked(costmap, self.path_m[1:]):
            return True
        blockage = self._blockage(self.path_m, costmap, base, window)
        if blockage is not Blockage.SURE:
            self._open_s = time_s
        if blockage is Blockage.NONE:
            self._valid_s = time_s
        return time_s - self._open_s >= BLOCKED_S - TINY_S or time_s - self._valid_s >= NARROW_S - TINY_S

    def _is_worth_the_detour(self, new_m: FloatArray, time_s: float, base: Pose2) -> bool:
        """Return whether a path replaces one that is missing, left or blocked.

        Somebody in a doorway may go on at once, or stand there. To wait for as long as the detour takes costs
        at most twice the time of the better choice (ski rental: Karlin et al., "Competitive Snoopy Caching",
        1988).
        """
        if self.path_m is None or self.keeps or self._is_left(self.path_m, base):
            return True
        detour_m = float(arc_lengths(new_m)[-1]) - self.remaining_m(base)
        return time_s - self._valid_s >= min(detour_m / DETOUR_PACE_M_S, MAX_KEPT_S) - TINY_S

    def _blockage(
        self, path_m: FloatArray, costmap: Costmap, base: Pose2, window: Costmap | None
    ) -> Blockage:
        """Return whether a path, shape (n, 2), is blocked beyond the robot, which is where it is already.

        An obstacle well inside the robot's width blocks it. One at its edge may be the coarseness of the
        cells: it counts where the finer window says so, too, so the robot drives nearer to look.
        """
        ahead_m = path_m[np.hypot(*(path_m - (base.x_m, base.y_m)).T) > self._circumscribed_m]
        if not is_blocked(costmap, ahead_m):
            return Blockage.NONE
        if is_off(costmap, ahead_m).any():
            return Blockage.SURE
        rows, cols = costmap.cells_of(ahead_m)
        room_m = math.sqrt(costmap.squared_cells[rows, cols].min()) * costmap.resolution_m
        if room_m < SURE_FRACTION * self._inscribed_m:
            return Blockage.SURE
        is_narrow = window is None or is_blocked(window, ahead_m[~is_off(window, ahead_m)])
        return Blockage.NARROW if is_narrow else Blockage.NONE

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
        """Whether the first search for a path goes on: there is none yet, and none is known to be missing."""
        return self.path_m is None and not self._is_searched and self._search.is_running

    def _can_turn_to(self, path_m: FloatArray, costmap: Costmap, base: Pose2) -> bool:
        """Return whether a path, shape (n, 2), begins ahead, or the robot has room to turn on the spot."""
        (row,), (col,) = costmap.cells_of(np.array([(base.x_m, base.y_m)]))
        if math.sqrt(costmap.squared_cells[row, col]) * costmap.resolution_m > self._circumscribed_m:
            return True
        steps_m = path_m - (base.x_m, base.y_m)
        far = np.flatnonzero(np.hypot(*steps_m.T) > self._circumscribed_m)
        x_m, y_m = steps_m[far[0] if far.size else -1]
        return abs(wrap_angle(math.atan2(y_m, x_m) - base.theta_rad)) < MAX_CURVE_RAD

    @staticmethod
    def _is_left(path_m: FloatArray, base: Pose2) -> bool:
        return math.hypot(path_m[0, 0] - base.x_m, path_m[0, 1] - base.y_m) > MAX_PATH_DISTANCE_M

    def _is_better(self, new_m: FloatArray, costmap: Costmap, base: Pose2) -> bool:
        """Return whether a path replaces the kept one, which nothing blocks for long.

        On the same side of all obstacles it must be clearly cheaper. On another side it must have been so in
        several searches in a row: noise must not send the robot back and forth.
        """
        joined_m = self._joined(base)
        new_cost = self._planner.path_cost_m(costmap, new_m)
        old_cost = self._planner.path_cost_m(costmap, joined_m)
        is_cheaper = new_cost < (1.0 - self._options.better_by) * old_cost
        if self.keeps and math.isinf(old_cost):  # blocked, perhaps only by noise: no time to compare
            return False
        if is_cheaper and is_same_side(new_m, joined_m, costmap):
            return True
        is_cheaper = is_cheaper and (not self.keeps or self._can_turn_to(new_m, costmap, base))
        self._cheaper_count = self._cheaper_count + 1 if is_cheaper else 0
        searches = (CHEAPER_SEARCHES if self.keeps else 1) << min(self._side_changes, MAX_DOUBLINGS)
        return self._cheaper_count >= searches

    def _joined(self, base: Pose2) -> FloatArray:
        """Return the path from the robot on, shape (n, 2)."""
        assert self.path_m is not None
        return np.vstack(((base.x_m, base.y_m), self.path_m))


def _pruned(path_m: FloatArray, map_from_base: Pose2) -> FloatArray:
    """Return a path without the part that the robot has passed."""
    start = nearest_vertex(path_m, map_from_base.x_m, map_from_base.y_m)
    return path_m[min(start, len(path_m) - 2) :]
