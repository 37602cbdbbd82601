"""Distances of goals that are known before the robot opens."""

import math

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.runtime.drive.goal_limits import check_distances

FAR = 99.0


def goals(*xs_m: float) -> list[Goal]:
    return [Goal(x_m=x_m, y_m=0.0) for x_m in xs_m]


@pytest.mark.parametrize("start", [None, Pose2()])
def test_each_goal_is_checked_from_the_one_before(start: Pose2 | None) -> None:
    check_distances(goals(40.0, 80.0, 120.0), start)
    with pytest.raises(ThumperError, match=r"\(99.*is 98 m from the goal before, \(1\.00, 0\.00\); choose"):
        check_distances(goals(1.0, FAR), start)


def test_the_first_is_checked_from_a_known_start() -> None:
    check_distances(goals(FAR), None)
    with pytest.raises(ThumperError, match="99 m from the start; choose a goal at most 50 m away"):
        check_distances(goals(FAR), Pose2())


@pytest.mark.parametrize(("x_m", "shown"), [(50.6, "51"), (50.3, "50.3"), (50.02, "50.02")])
def test_the_distance_is_shown_beyond_the_limit(x_m: float, shown: str) -> None:
    with pytest.raises(ThumperError, match=f" is {shown} m from the start; choose a goal at most 50 m away"):
        check_distances(goals(x_m), Pose2())


def test_the_least_distance_beyond_the_limit_is_shown() -> None:
    check_distances(goals(50.0), Pose2())
    with pytest.raises(ThumperError, match=r" is 50\.0+1 m from the start"):
        check_distances(goals(math.nextafter(50.0, math.inf)), Pose2())
