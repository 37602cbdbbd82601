"""Decides that the robot is there: come near, stop, turn to the heading, and only then say so."""

import math

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal

NEAR_ENOUGH = 0.5  # part of the tolerance at which the robot stops without trying to get nearer
PASSED_M = 0.02  # inside the tolerance it also stops when it has moved away again by this much ...
PASSED_PART = 0.25  # ... or by this part of the tolerance
LEAST_HOLD_M = 0.05  # a turn on the spot moves a skid-steered base, and its estimate, by some 2 cm


class GoalChecker:
    """Latches once the place is reached: noise at the edge of the tolerance must not make the robot dance.

    move_base calls it `latch_xy_goal_tolerance`. Here a robot that is carried well away is let go.
    """

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._passed_m = min(PASSED_M, PASSED_PART * goal.tolerance_m)
        self._hold_m = max(LEAST_HOLD_M, goal.tolerance_m)
        self.at_place = False
        self._least_m = math.inf

    def update(self, map_from_base: Pose2) -> None:
        """Latch or, when the robot has drifted well out of the tolerance again, let go."""
        distance_m = self._goal.distance_m(map_from_base)
        tolerance_m = self._goal.tolerance_m
        self._least_m = min(self._least_m, distance_m)
        if self.at_place:
            if distance_m > self._hold_m:
                self.at_place, self._least_m = False, distance_m
            return
        passed = distance_m > self._least_m + self._passed_m
        self.at_place = distance_m <= NEAR_ENOUGH * tolerance_m or (distance_m <= tolerance_m and passed)

    def is_turned(self, map_from_base: Pose2) -> bool:
        """Whether the heading is good enough as it is."""
        return abs(self._goal.heading_error_rad(map_from_base)) <= self._goal.heading_tolerance_rad
