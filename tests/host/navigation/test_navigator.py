"""The navigator's states, its checks at start-up, and that it never raises in motion."""

import math

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.goal_checker import GoalChecker
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.goal_validation import validate_goal
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.recovery.progress_checker import ProgressCheck, ProgressChecker, ProgressOptions
from thumper.navigation.state import ScanFrames

NO_HITS = np.empty((0, 2))
A = Goal(x_m=1.0, y_m=0.0)
CENTRE_OF_ROTATION = Pose2(x_m=-0.05)  # in base_link


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
def test_invalid_pose_stops_the_robot(pose: Pose2, word: str) -> None:
    navigator = make()
    navigator.set_goal(Goal(x_m=1.0, y_m=0.0))
    for cycle in range(400):
        output = step(navigator, 0.1 * cycle, pose)
        assert output.command == Twist2()
    assert output.state is NavigationState.FAILED
    assert word in output.reason


def test_internal_error_stops_with_a_reason() -> None:
    navigator = make()
    navigator.set_goal(Goal(x_m=1.0, y_m=0.0))
    assert step(navigator).command.v_m_s > 0.0
    output = navigator.update(0.1, Pose2(), Twist2(), free_grid(), np.zeros((4, 3, 2)))
    assert output.command == Twist2()
    assert output.state is NavigationState.FAILED
    assert "internal error" in output.reason


def test_an_error_while_something_else_drives_leaves_the_newest_scan() -> None:
    """It must not end manual driving, and with it the way out."""
    navigator, hits_m = make(), np.array(((0.5, 0.0), (np.nan, 0.0)))
    frames = ScanFrames(Pose2(x_m=math.nan), Pose2())
    navigator.observe(0.0, Pose2(x_m=math.nan), free_grid(), hits_m, lost="", frames=frames)
    assert navigator.obstacles.points_m.tolist() == [[0.5, 0.0]]
    assert navigator.obstacles.seen == 1


@pytest.mark.parametrize("parked", [False, True])
@pytest.mark.parametrize(("in_view", "idle_s"), [(True, 1.0), (False, 1.0), (False, 25.0)])
def test_after_a_drive_costs_lose_what_rays_pass_and_keep_what_is_out_of_view(
    in_view: bool, idle_s: float, parked: bool
) -> None:
    """The last scan of a drive hit something that later ones look through, or that the robot leaves."""
    navigator = make()
    there_m = np.array(((0.4, 0.0), (0.4, 0.01)))
    wall_m = np.column_stack((np.full(201, 2.0), np.linspace(-1.0, 1.0, 201)))
    navigator.set_goal(A)
    navigator.update(0.0, Pose2(), Twist2(), free_grid(), np.vstack((there_m, wall_m)))
    navigator.cancel()
    pose, hits_m = (Pose2(), wall_m) if in_view else (Pose2(theta_rad=math.pi), NO_HITS)
    for time_s in (0.1, idle_s):
        frames = ScanFrames(pose, Pose2())
        navigator.observe(time_s, pose, free_grid(), hits_m, lost="", frames=frames, parked=parked)
    costmap = navigator.costmap
    assert costmap is not None
    assert (costmap.costs[costmap.cells_of(there_m)] == LETHAL).all() == (not in_view)


def test_a_parked_robot_does_not_remember_who_passes() -> None:
    navigator, passer_m = make(), np.array(((0.4, 0.0), (0.4, 0.01)))
    navigator.set_goal(A)
    step(navigator)
    navigator.cancel()
    for time_s, hits_m in ((1.0, passer_m), (2.0, NO_HITS)):
        pose = Pose2(theta_rad=0.0 if len(hits_m) else math.pi)  # it is turned, and sees no more
        frames = ScanFrames(pose, Pose2())
        navigator.observe(time_s, pose, free_grid(), hits_m, lost="", frames=frames, parked=True)
        costmap = navigator.costmap
        assert costmap is not None
        assert (costmap.costs[costmap.cells_of(passer_m)] == LETHAL).all() == bool(len(hits_m))


def test_unknown_names_are_rejected_at_start() -> None:
    with pytest.raises(ThumperError, match="unknown planner 'warp'; choose from: astar"):
        Navigator(NavigationOptions(planner="warp"), Footprint())
    with pytest.raises(ThumperError, match="unknown controller 'warp'; choose from: cascade, dwa"):
        Navigator(NavigationOptions(controller="warp"), Footprint())


def test_invalid_goals_are_rejected_with_one_line() -> None:
    grid = free_grid()
    grid.cells[50:60, 70:80] = 100
    planner = AStarPlanner(TraversalCostOptions())
    validate_goal(Goal(x_m=-1.0, y_m=0.0), grid, Footprint(), planner)
    with pytest.raises(ThumperError, match=r"goal \(9\.00, 0\.00\) is outside the map \(x -2\.50 to 2\.50 m"):
        validate_goal(Goal(x_m=9.0, y_m=0.0), grid, Footprint(), planner)
    with pytest.raises(ThumperError, match="too near an obstacle") as caught:
        validate_goal(Goal(x_m=1.25, y_m=0.25), grid, Footprint(), planner)
    assert "\n" not in str(caught.value)
    grid.cells[:] = -1
    validate_goal(Goal(x_m=1.25, y_m=0.25), grid, Footprint(), planner)
    with pytest.raises(ValueError, match="finite"):
        Goal(x_m=math.nan, y_m=0.0)


@pytest.mark.parametrize("planner", ["astar", "navfn", "lattice"])
@pytest.mark.parametrize("allow_unknown", [True, False])
def test_goals_in_unknown_space_are_valid_only_if_the_planner_allows_it(
    planner: str, allow_unknown: bool
) -> None:
    grid = free_grid()
    grid.cells[:, 60:] = -1
    options = NavigationOptions(planner=planner, traversal=TraversalCostOptions(allow_unknown=allow_unknown))
    navigator = Navigator(options, Footprint())
    navigator.validate_goal(Goal(x_m=0.0, y_m=0.0), grid)
    if allow_unknown:
        navigator.validate_goal(Goal(x_m=1.5, y_m=0.0), grid)
    else:
        with pytest.raises(ThumperError, match=r"goal \(1\.50, 0\.00\) is in unknown space"):
            navigator.validate_goal(Goal(x_m=1.5, y_m=0.0), grid)


def test_goal_checker_latches_and_releases() -> None:
    checker = GoalChecker(Goal(x_m=0.0, y_m=0.0, tolerance_m=0.1))
    seen = []
    for x_m in (0.3, 0.09, 0.08, 0.105, 0.09, 0.04, 0.09, 0.11):
        checker.update(Pose2(x_m=x_m))
        seen.append(checker.position_reached)
    # 0.105 is outside; 0.09 after 0.08 is not yet past by 2 cm; 0.04 is near enough; 0.11 releases.
    assert seen == [False, False, False, False, False, True, True, False]


def test_small_tolerance_applies_to_the_stop_not_to_the_rotation_after_it() -> None:
    checker = GoalChecker(Goal(x_m=0.0, y_m=0.0, theta_rad=1.0, tolerance_m=0.02))
    seen = []
    for x_m in (0.05, 0.012, 0.018, 0.03, 0.149, 0.151):
        checker.update(Pose2(x_m=x_m))
        seen.append(checker.position_reached)
    # 0.018 is inside, and past by more than a quarter of the tolerance; a rotation does not release it.
    assert seen == [False, False, True, True, True, False]


def test_robot_that_has_turned_away_from_the_place_drives_back() -> None:
    checker = GoalChecker(Goal(x_m=0.0, y_m=0.0, theta_rad=1.0, tolerance_m=0.02))
    for x_m, theta_rad, expected in ((0.0, 0.0, True), (0.08, 0.5, True), (0.08, 1.0, False)):
        checker.update(Pose2(x_m=x_m, theta_rad=theta_rad))
        assert checker.position_reached is expected


@pytest.mark.parametrize(("bearing_deg", "theta_rad"), [(180, -1.0), (225, 2.0), (270, 2.0), (270, -1.0)])
def test_goal_with_a_heading_is_reached_by_a_robot_that_turns_about_a_centre_behind_it(
    bearing_deg: int, theta_rad: float
) -> None:
    """`base_link` moves on a circle as wide as the tolerance while the robot turns."""
    goal = Goal(x_m=0.0, y_m=0.0, theta_rad=0.0, tolerance_m=0.05, heading_tolerance_rad=0.1)
    bearing_rad = math.radians(bearing_deg)
    pose = Pose2(x_m=0.4 * math.cos(bearing_rad), y_m=0.4 * math.sin(bearing_rad), theta_rad=theta_rad)
    navigator, twist = make(), Twist2()
    navigator.set_goal(goal)
    for cycle in range(200):
        output = navigator.update(0.1 * cycle, pose, twist, free_grid(), NO_HITS)
        if output.state is NavigationState.REACHED:
            break
        twist = output.command
        moved = Pose2(x_m=0.1 * twist.v_m_s, y_m=0.0, theta_rad=0.1 * twist.w_rad_s)
        pose = pose @ CENTRE_OF_ROTATION @ moved @ CENTRE_OF_ROTATION.inverse()
    assert output.state is NavigationState.REACHED, output.reason
    assert goal.distance_m(pose) <= goal.tolerance_m
    assert abs(goal.heading_error_rad(pose)) <= goal.heading_tolerance_rad


def test_progress_requires_movement_and_then_nearness() -> None:
    checker = ProgressChecker(ProgressOptions(still_s=2.0, idle_s=5.0))
    assert checker.update(0.0, Pose2(), 3.0) == ProgressCheck(nearer=True, problem=None)
    assert checker.update(2.1, Pose2(x_m=0.05), 3.0).problem == "no movement for 2 s"
    checker.restart_timers()
    problem = None
    for cycle in range(60):  # oscillates in place, never nearer
        problem = checker.update(3.0 + 0.1 * cycle, Pose2(theta_rad=0.6 * (cycle % 10)), 3.0).problem
    assert problem == "no nearer to the goal for 5 s"


def test_new_goal_replaces_the_old_one_at_once() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(A)
    assert step(navigator, 0.0).plan[-1] == pytest.approx((1.0, 0.0))
    navigator.set_goal(Goal(x_m=1.0, y_m=0.5))
    assert step(navigator, 0.1).plan[-1] == pytest.approx((1.0, 0.5))


def test_cancelled_goal_stops_and_a_new_goal_drives_on() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(A)
    assert step(navigator, 0.0).command.v_m_s > 0.0
    navigator.cancel()
    stopped = step(navigator, 0.1)
    assert (stopped.command, stopped.state, stopped.reason) == (Twist2(), NavigationState.IDLE, "cancelled")
    assert navigator.transitions[-1].reason == "cancelled"
    navigator.set_goal(A)
    assert step(navigator, 0.2).command.v_m_s > 0.0


def test_goal_that_comes_and_goes_is_aborted() -> None:
    """Its cell is free at times and blocked at others: nothing retries for ever."""
    navigator = Navigator(NavigationOptions(), Footprint())
    goal, pose, twist = Goal(x_m=1.5, y_m=0.0), Pose2(), Twist2()
    navigator.set_goal(goal)
    cells = np.zeros((100, 100), np.int8)
    grids = []
    for shut in (False, True):
        shown = cells.copy()
        if shut:
            shown[40:60, 70:72] = 100
            shown[40:42, 70:90] = shown[58:60, 70:90] = 100
            shown[40:60, 88:90] = 100
        grids.append(OccupancyGrid(cells=shown, resolution_m=0.05, origin_x_m=-2.5, origin_y_m=-2.5))
    for cycle in range(1200):
        time_s = 0.1 * cycle
        blocked = cycle // 25 % 2 == 1 and pose.x_m > 0.5
        output = navigator.update(time_s, pose, twist, grids[blocked], np.empty((0, 2)))
        twist = output.command
        pose = pose @ Pose2(x_m=0.1 * twist.v_m_s, theta_rad=0.1 * twist.w_rad_s)
        if pose.x_m > 0.75:  # held by the wall that it sees only at times
            pose = Pose2(x_m=0.75, y_m=pose.y_m, theta_rad=pose.theta_rad)
        if output.state is NavigationState.FAILED:
            break
    assert output.state is NavigationState.FAILED
    assert "gave up" in output.reason
    assert time_s < 90.0
