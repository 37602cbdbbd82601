"""Check whether the goal is reached: first the position, then, at standstill, the heading."""

import math

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


class GoalChecker:
    """Latches once the position is reached; noise at the edge of the tolerance must not restart the drive.

    As move_base's `latch_xy_goal_tolerance`, but a robot that is moved well away is released.
    """

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._passed_m = min(PASSED_M, PASSED_FRACTION * goal.tolerance_m)
        self._hold_m = max(MIN_HOLD_M, goal.tolerance_m)
        self._least_m = math.inf
        self.position_reached = False

    def update(self, map_from_base: Pose2) -> None:
        """Latch, or release if the robot has left the tolerance by far."""
        distance_m = self._goal.distance_m(map_from_base)
        tolerance_m = self._goal.tolerance_m
        self._least_m = min(self._least_m, distance_m)
        if self.position_reached:
            turning = abs(self._goal.heading_error_rad(map_from_base)) > self._goal.heading_tolerance_rad
            if distance_m > self._hold_m + (TURNING_M if turning else 0.0):
                self.position_reached, self._least_m = False, distance_m
            return
        passed = distance_m > self._least_m + self._passed_m
        self.position_reached = distance_m <= NEAR_ENOUGH * tolerance_m or (
            distance_m <= tolerance_m and passed
        )

    def accept_within_tolerance(self, map_from_base: Pose2) -> None:
        """Latch if the robot is within the tolerance: it is stationary, as near to the goal as it gets."""
        if not self.position_reached:
            self.position_reached = self._goal.distance_m(map_from_base) <= self._goal.tolerance_m

    def is_reached(self, map_from_base: Pose2, twist: Twist2) -> bool:
        """Return whether the robot is stationary at the goal, with its heading."""
        error_rad = abs(self._goal.heading_error_rad(map_from_base))
        return self.position_reached and is_still(twist) and error_rad <= self._goal.heading_tolerance_rad
