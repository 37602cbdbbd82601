"""The last piece of the way to a goal beside obstacles: to the nearest pose at which the robot fits.

A robot that stops within the tolerance and then turns needs room for a circle. Beside a wall it has none, so
it must arrive in a heading in which it fits, and the way there must allow for that.
"""

import math

from thumper.common.geometry import Pose2, Twist2
from thumper.common.texts import place_text
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.goal_checker import NEAR_ENOUGH
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.goal_poses import has_turning_room, search_goal_poses
from thumper.navigation.speed_limits import is_still

BEGIN_M = 0.8  # from the goal
AGAIN_M = 0.25  # nearer, or after AGAIN_CYCLES, it looks once more
AGAIN_CYCLES = 20
MOST_ATTEMPTS = 8
BLOCKED_CYCLES = 4  # then it plans again from where it is
SAME_PLACE_M = 0.03


class GoalManoeuvre:
    """Plans the way to the poses at one goal, and follows it; `reset` for another goal."""

    def __init__(self, follower: PoseSequenceFollower, footprint: Footprint) -> None:
        """`footprint` is the one of planning."""
        self._follower = follower
        self._footprint = footprint
        self.reset()

    def reset(self) -> None:
        """Forget the goal."""
        self.stop()
        self._attempts, self._failed_m, self._cycles, self._blocked = 0, math.inf, 0, 0
        self.arrived = False  # at the pose; cleared when the robot drives on
        self.place = ""  # where the robot is to stop, if not at the goal

    def stop(self) -> None:
        """End the manoeuvre; another may begin."""
        self._follower.stop()
        self._stopping = self._wanted = False

    def on_yielding(self) -> None:
        """The robot waits for somebody who moves: its command was not refused."""
        self._wanted = False

    @property
    def active(self) -> bool:
        """Whether the robot is on the way to the pose."""
        return self._stopping or self._follower.is_planning or self._follower.active

    def compute_command(self, request: ControlRequest, goal: Goal) -> ControlResult | None:
        """Return the next twist; None if the goal has room, is far, or no way leads to a pose at it."""
        self.arrived = False
        if self._follower.active:
            return self._follow(request, goal)
        if self._follower.is_planning:
            return self._plan(request, goal)
        if self._stopping:
            if not is_still(request.twist):
                return ControlResult(command=Twist2())
            return self._begin(request, goal)
        distance_m = goal.distance_m(request.map_from_base)
        self._cycles += 1
        if (
            distance_m > BEGIN_M
            or self._attempts >= MOST_ATTEMPTS
            or (distance_m > self._failed_m - AGAIN_M and self._cycles < AGAIN_CYCLES)
            or has_turning_room(request.costmap, self._footprint, goal)
        ):
            return None
        self._stopping = True
        return ControlResult(command=Twist2())

    def _begin(self, request: ControlRequest, goal: Goal) -> ControlResult:
        """Begin to search the poses and the way."""
        self._stopping, self._blocked, self.place = False, 0, ""
        self._wanted = False
        self._attempts += 1
        self._failed_m, self._cycles = goal.distance_m(request.map_from_base), 0
        costmap = request.fine_costmap() if request.fine_costmap else request.costmap
        self._follower.plan_to(request, costmap, search_goal_poses(costmap, self._footprint, goal))
        return ControlResult(command=Twist2())

    def _plan(self, request: ControlRequest, goal: Goal) -> ControlResult | None:
        started = self._follower.advance()
        if started is None:
            return ControlResult(command=Twist2())
        if not started:
            return None
        x_m, y_m, theta_rad = self._follower.last_pose
        if math.dist((x_m, y_m), (goal.x_m, goal.y_m)) > SAME_PLACE_M:
            heading_deg = math.degrees(math.remainder(theta_rad, math.tau))
            self.place = f"{place_text(x_m, y_m)}, heading {heading_deg:.0f} degrees"
        return self._follow(request, goal)

    def _follow(self, request: ControlRequest, goal: Goal) -> ControlResult | None:
        refused = self._wanted and request.last_command == Twist2()
        result = self._follower.compute_command(request)
        if self._is_there(request, goal, result):
            self._follower.stop()
            result = None
        self._wanted = result is not None and result.command not in (None, Twist2())
        blocked = refused or (result is not None and result.command is None)
        self._blocked = self._blocked + 1 if blocked else 0
        if self._blocked > BLOCKED_CYCLES:
            self._follower.stop()
            self._stopping = self._attempts < MOST_ATTEMPTS
            return ControlResult(command=Twist2()) if self._stopping else None
        if result is not None:
            return result
        base = request.map_from_base
        self.arrived = _is_at(goal, base, goal.tolerance_m)
        if self.arrived:
            return ControlResult(command=Twist2())
        self.place = ""
        self._stopping = self._attempts < MOST_ATTEMPTS  # else the usual controllers go on
        return ControlResult(command=Twist2()) if self._stopping else None

    def _is_there(self, request: ControlRequest, goal: Goal, result: ControlResult | None) -> bool:
        """Return whether the poses that are left bring the robot no nearer: it fits where it is."""
        turns = result is not None and result.command is not None and result.command.v_m_s == 0.0
        tolerance_m = goal.tolerance_m if turns else NEAR_ENOUGH * goal.tolerance_m
        return not self.place and _is_at(goal, request.map_from_base, tolerance_m)


def _is_at(goal: Goal, base: Pose2, tolerance_m: float) -> bool:
    is_turned = abs(goal.heading_error_rad(base)) <= goal.heading_tolerance_rad
    return is_turned and goal.distance_m(base) <= tolerance_m
