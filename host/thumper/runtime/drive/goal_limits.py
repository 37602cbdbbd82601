"""Refuses goals that the robot cannot reach in any map: too far away, or where it does not fit."""

from collections.abc import Iterable
from dataclasses import dataclass

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.navigation.costmap.filters import is_kept_out
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.runtime.drive.drive_manager import GOAL_MARGIN_M
from thumper.runtime.state_estimator import StateEstimator

MAX_GOAL_DISTANCE_M = 50.0  # the map of a whole drive must fit into memory and planning time


def check_distance(goal: Goal, map_from_base: Pose2, place: str = "the robot") -> None:
    """Raise ThumperError if the goal is too far from the robot, or from where it will be: `place`."""
    if (distance_m := goal.distance_m(map_from_base)) > MAX_GOAL_DISTANCE_M:
        raise ThumperError(
            f"goal {goal} is {_shown_beyond_limit(distance_m)} m from {place}; choose a goal at most "
            f"{MAX_GOAL_DISTANCE_M:.0f} m away",
            exit_code=EXIT_USAGE,
        )


def _shown_beyond_limit(distance_m: float) -> str:
    """Return a distance beyond the limit with as few decimals as show that: 50.02, not 50."""
    shown = (f"{distance_m:.{decimals}f}" for decimals in range(17))
    return next(text for text in shown if float(text) > MAX_GOAL_DISTANCE_M)


def check_distances(goals: Iterable[Goal], start: Pose2 | None) -> None:
    """Raise ThumperError if a goal is too far from the one before it, or the first from a known start."""
    before, place = start, "the start"
    for goal in goals:
        if before is not None:
            check_distance(goal, before, place)
        before, place = Pose2(x_m=goal.x_m, y_m=goal.y_m), f"the goal before, {goal}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalLimits:
    """Checks goals against the robot's position, its map and its planner."""

    estimator: StateEstimator
    navigator: Navigator

    def check(self, goal: Goal) -> None:
        """Raise ThumperError with the reason if the goal cannot be driven to."""
        state = self.estimator.state()
        assert state is not None  # no goal is accepted before there is a map
        if is_kept_out(self.navigator.keepout, state.map_from_base.x_m, state.map_from_base.y_m):
            raise ThumperError("the robot is in a keep-out zone: drive it out manually, or remove the zone")
        check_distance(goal, state.map_from_base)
        self.check_in_map(goal)

    def check_in_map(self, goal: Goal) -> None:
        """Raise ThumperError with the reason if the robot has no room at the goal, by the map so far."""
        grid = self.estimator.mapper.grid().including(goal.x_m, goal.y_m, GOAL_MARGIN_M)
        self.navigator.validate_goal(goal, grid)
