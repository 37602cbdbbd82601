"""The navigator's states, its checks at start-up, and its promise never to raise in motion."""

import math

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.goal_checker import GoalChecker
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.goal_validation import validate_goal
from thumper.navigation.recovery.progress_checker import ProgressChecker, ProgressOptions

NO_HITS = np.empty((0, 2))


def free_grid() -> OccupancyGrid:
    return OccupancyGrid(
        cells=np.zeros((100, 100), np.int8), resolution_m=0.05, origin_x_m=-2.5, origin_y_m=-2.5
    )


def make() -> Navigator:
    return Navigator(NavigationOptions(), Footprint())


def step(navigator: Navigator, time_s: float = 0.0, pose: Pose2 | None = None) -> NavigationOutput:
    return navigator.update(time_s, pose or Pose2(), Twist2(), free_grid(), NO_HITS)


def test_idle_until_a_goal_is_set_and_after_cancel() -> None:
    navigator = make()
    assert (step(navigator).state, step(navigator).command) == (NavigationState.IDLE, Twist2())
    navigator.set_goal(Goal(x_m=1.0, y_m=0.0))
    moving = step(navigator, 0.1)
    assert moving.state is NavigationState.NAVIGATING
    assert moving.command.v_m_s > 0.0
    assert moving.plan[-1] == pytest.approx((1.0, 0.0))
    assert moving.local_plan.shape[1] == 3
    navigator.cancel()
    assert step(navigator, 0.2).command == Twist2()


def test_reached_stays_reached_until_the_next_goal() -> None:
    navigator = make()
    navigator.set_goal(Goal(x_m=0.02, y_m=0.0))
    assert step(navigator).state is NavigationState.REACHED
    assert step(navigator, 0.1, Pose2(x_m=1.0)).state is NavigationState.REACHED
    navigator.set_goal(Goal(x_m=0.02, y_m=0.0))
    assert step(navigator, 0.2, Pose2(x_m=1.0)).state is NavigationState.ROTATING


@pytest.mark.parametrize(
    ("pose", "word"),
    [(Pose2(x_m=math.nan), "not a number"), (Pose2(x_m=99.0), "outside the map")],
)
def test_a_senseless_pose_stops_the_robot(pose: Pose2, word: str) -> None:
    navigator = make()
    navigator.set_goal(Goal(x_m=1.0, y_m=0.0))
    for cycle in range(400):
        output = step(navigator, 0.1 * cycle, pose)
        assert output.command == Twist2()
    assert output.state is NavigationState.FAILED
    assert word in output.reason


def test_an_internal_error_is_a_stop_with_a_reason() -> None:
    navigator = make()
    navigator.set_goal(Goal(x_m=1.0, y_m=0.0))
    assert step(navigator).command.v_m_s > 0.0
    output = navigator.update(0.1, Pose2(), Twist2(), free_grid(), np.zeros((4, 3, 2)))
    assert output.command == Twist2()
    assert output.state is NavigationState.FAILED
    assert "internal error" in output.reason


def test_unknown_names_are_refused_at_start() -> None:
    with pytest.raises(ThumperError, match="no planner 'warp': choose one of astar"):
        Navigator(NavigationOptions(planner="warp"), Footprint())
    with pytest.raises(ThumperError, match="no controller 'warp': choose one of cascade, dwa"):
        Navigator(NavigationOptions(controller="warp"), Footprint())


def test_senseless_goals_are_refused_in_one_line() -> None:
    grid = free_grid()
    grid.cells[50:60, 70:80] = 100
    validate_goal(Goal(x_m=-1.0, y_m=0.0), grid, Footprint())
    with pytest.raises(ThumperError, match=r"goal \(9\.00, 0\.00\) is outside the map \(x -2\.50 to 2\.50 m"):
        validate_goal(Goal(x_m=9.0, y_m=0.0), grid, Footprint())
    with pytest.raises(ThumperError, match="too near an obstacle") as caught:
        validate_goal(Goal(x_m=1.25, y_m=0.25), grid, Footprint())
    assert "\n" not in str(caught.value)
    grid.cells[:] = -1
    validate_goal(Goal(x_m=1.25, y_m=0.25), grid, Footprint())
    with pytest.raises(ValueError, match="finite"):
        Goal(x_m=math.nan, y_m=0.0)


def test_arrival_latches_and_lets_go() -> None:
    arrival = GoalChecker(Goal(x_m=0.0, y_m=0.0, tolerance_m=0.1))
    seen = []
    for x_m in (0.3, 0.09, 0.08, 0.105, 0.09, 0.04, 0.09, 0.11):
        arrival.update(Pose2(x_m=x_m))
        seen.append(arrival.at_place)
    # 0.105 is outside; 0.09 after 0.08 is not yet past by 2 cm; 0.04 is near enough; 0.11 lets go.
    assert seen == [False, False, False, False, False, True, True, False]


def test_a_small_tolerance_is_for_the_place_not_for_the_turn_after_it() -> None:
    arrival = GoalChecker(Goal(x_m=0.0, y_m=0.0, theta_rad=1.0, tolerance_m=0.02))
    seen = []
    for x_m in (0.05, 0.012, 0.018, 0.03, 0.049, 0.051):
        arrival.update(Pose2(x_m=x_m))
        seen.append(arrival.at_place)
    # 0.018 is inside, and past by more than a quarter of the tolerance; what a turn moves does not let go.
    assert seen == [False, False, True, True, True, False]


def test_progress_wants_movement_and_then_nearness() -> None:
    checker = ProgressChecker(ProgressOptions(still_s=2.0, idle_s=5.0))
    assert checker.update(0.0, Pose2(), 3.0) == ("", True)
    assert checker.update(2.1, Pose2(x_m=0.05), 3.0)[0] == "no movement for 2 s"
    checker.renew()
    complaint = ""
    for cycle in range(60):  # dances on the spot, never nearer
        complaint, _ = checker.update(3.0 + 0.1 * cycle, Pose2(theta_rad=0.6 * (cycle % 10)), 3.0)
    assert complaint == "no nearer to the goal for 5 s"
