"""Check whether the goal is reached: first the position, then, at standstill, the heading."""

import math
from dataclasses import replace

from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.goal import Goal
from thumper.navigation.speed_limits import is_still

NEAR_ENOUGH = 0.5  # fraction of the tolerance at which the robot stops without trying to get nearer
PASSED_M = 0.02  # inside the tolerance it also stops when it has moved away again by this much ...
PASSED_FRACTION = 0.25  # ... or by this fraction of the tolerance
MIN_HOLD_M = 0.05  # rotating in place moves a skid-steered base, and its estimate, by about 2 cm
# A skid-steered base turns about a centre up to 5 cm off `base_link`, which moves by up to twice that. While
# it turns to the goal's heading that is no reason to drive back: it would never end a turn.
TURNING_M = 0.10
LEARN_RAD = 0.5  # a turn by less shows nothing of its centre
MAX_CENTRE_M = 0.10  # a centre further off base_link means that somebody pushed the robot, or the map jumped


class GoalChecker:
    """Latches once the position is reached; noise at the edge of the tolerance must not restart the drive.

    As move_base's `latch_xy_goal_tolerance`, but a robot that is moved well away is released.
    """

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._passed_m = min(PASSED_M, PASSED_FRACTION * goal.tolerance_m)
        self._hold_m = max(MIN_HOLD_M, goal.tolerance_m)
        self._least_m = math.inf
        self._turn_start: Pose2 | None = None
        # Centre of rotation in base_link; None until a turn has led out of the tolerance.
        self._base_from_centre: Pose2 | None = None
        self.position_reached = False

    def update(self, map_from_base: Pose2) -> None:
        """Latch, or release if the robot has left the tolerance by far."""
        stop = self.stop_goal(map_from_base) or self._goal
        distance_m = stop.distance_m(map_from_base)
        tolerance_m = self._goal.tolerance_m
        self._least_m = min(self._least_m, distance_m)
        if self.position_reached:
            turning = abs(self._goal.heading_error_rad(map_from_base)) > self._goal.heading_tolerance_rad
            if distance_m > self._hold_m + (TURNING_M if turning else 0.0):
                self.position_reached, self._least_m = False, distance_m
                if not turning:
                    self._learn_centre(map_from_base)
            return
        passed = distance_m > self._least_m + self._passed_m
        self.position_reached = distance_m <= NEAR_ENOUGH * tolerance_m or (
            distance_m <= tolerance_m and passed
        )
        self._turn_start = map_from_base

    def stop_goal(self, map_from_base: Pose2) -> Goal | None:
        """Return where to stop, so that the turn to the goal's heading ends at the goal.

        None as long as no turn has shown that this is another place.
        """
        goal, base_from_centre = self._goal, self._base_from_centre
        if base_from_centre is None or goal.theta_rad is None:
            return None
        centre = Pose2(x_m=goal.x_m, y_m=goal.y_m, theta_rad=goal.theta_rad) @ base_from_centre
        stop = replace(centre, theta_rad=map_from_base.theta_rad) @ base_from_centre.inverse()
        return replace(goal, x_m=stop.x_m, y_m=stop.y_m)

    def _learn_centre(self, end: Pose2) -> None:
        """Find the point of the robot that stayed in place in the turn: c = t + R c in the first frame."""
        if self._turn_start is None:
            return
        moved = self._turn_start.inverse() @ end
        if abs(moved.theta_rad) < LEARN_RAD:
            return
        cot = 1.0 / math.tan(0.5 * moved.theta_rad)
        x_m, y_m = 0.5 * (moved.x_m - cot * moved.y_m), 0.5 * (moved.y_m + cot * moved.x_m)
        if math.hypot(x_m, y_m) <= MAX_CENTRE_M:
            self._base_from_centre = Pose2(x_m=x_m, y_m=y_m)

    def accept_within_tolerance(self, map_from_base: Pose2) -> None:
        """Latch if the robot is within the tolerance: it is stationary, as near to the goal as it gets."""
        if not self.position_reached:
            self.position_reached = self._goal.distance_m(map_from_base) <= self._goal.tolerance_m

    def is_reached(self, map_from_base: Pose2, twist: Twist2) -> bool:
        """Return whether the robot is stationary at the goal, with its heading."""
        error_rad = abs(self._goal.heading_error_rad(map_from_base))
        return self.position_reached and is_still(twist) and error_rad <= self._goal.heading_tolerance_rad
