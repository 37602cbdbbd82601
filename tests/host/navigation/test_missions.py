"""The navigator in a closed loop: noise, delay, slip, and a map that grows as the robot sees."""

import math
import re
from collections.abc import Callable

import pytest

from tests.variants import some_of
from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper.navigation.options import NavigationOptions
from thumper.navigation.recovery.behaviors import RecoveryOptions
from thumper_hil.kinematic.closed_loop import Conditions, Run, drive
from thumper_hil.kinematic.world import KinematicWorld, box

ROOM = KinematicWorld.from_boxes(box(0.8, 0.0, 4.8, 3.8))
AREA = (-4.2, -5.0, 10.0, 10.0)
BOX_ROOM = ROOM.with_boxes(box(1.2, 0.1, 0.40, 0.30, 0.58))
STRAIGHT = (Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi), (-0.49, 0.02))
ROUND_BOX = (Pose2(x_m=2.05, y_m=0.64, theta_rad=-2.56), (0.38, -0.45))


def assert_arrived(run: Run, error_m: float = 0.10) -> None:
    assert (run.state, run.reason[:4]) == (NavigationState.REACHED, "at t")
    assert run.goal_error_m <= error_m
    assert run.clearance_m > 0.02


@pytest.mark.parametrize("seed", some_of(range(4)))
def test_straight_run(seed: int) -> None:
    start, (x_m, y_m) = STRAIGHT
    run = drive(ROOM, start, Goal(x_m=x_m, y_m=y_m), AREA, seed=seed)
    assert_arrived(run)
    assert run.length_m < 1.05 * math.dist((start.x_m, start.y_m), (x_m, y_m))
    assert run.time_s < 12.0


@pytest.mark.parametrize("seed", some_of(range(4)))
def test_round_the_box(seed: int) -> None:
    start, (x_m, y_m) = ROUND_BOX
    run = drive(BOX_ROOM, start, Goal(x_m=x_m, y_m=y_m), AREA, seed=seed)
    assert_arrived(run)
    assert run.time_s < 20.0


def test_rotates_first_and_ends_at_the_goal_heading() -> None:
    start = Pose2(x_m=2.05, y_m=0.64, theta_rad=0.0)
    goal = Goal(x_m=0.38, y_m=-0.45, theta_rad=1.0)
    run = drive(BOX_ROOM, start, goal, AREA, conditions=Conditions(known_start=True))
    assert_arrived(run)
    assert run.outputs[0].state is NavigationState.ROTATING
    assert abs(goal.heading_error_rad(run.track[-1])) < goal.heading_tolerance_rad + 0.02


@pytest.mark.parametrize("wall_m", [0.16, pytest.param(0.20, marks=pytest.mark.slow)])
def test_goal_along_a_wall_is_entered_in_its_heading(wall_m: float) -> None:
    """The robot cannot turn 0.20 m from a wall; 0.16 m from it, it stops at the nearest pose that fits."""
    goal = Goal(x_m=2.0, y_m=wall_m - 1.9, theta_rad=math.pi)
    run = drive(ROOM, Pose2(), goal, AREA, conditions=Conditions(known_start=True))
    assert_arrived(run, error_m=0.12)
    assert abs(goal.heading_error_rad(run.track[-1])) < goal.heading_tolerance_rad + 0.02
    if wall_m < 0.18:
        assert re.match(
            r"at the nearest pose with room for the robot, 0\.\d\d m from the goal \(", run.reason
        )
        assert any("no room at the goal" in output.reason for output in run.outputs)
    assert run.time_s < 40.0


def test_goal_with_the_nose_in_a_wall_ends_soon() -> None:
    """There is room along the wall, but not in the goal's heading."""
    goal = Goal(x_m=1.5, y_m=-1.9 + 0.08, theta_rad=-0.5 * math.pi)
    run = drive(ROOM, Pose2(), goal, AREA, conditions=Conditions(known_start=True))
    assert run.state is NavigationState.FAILED
    assert "there is no room for the robot at the goal" in run.reason
    assert run.time_s < 25.0


@pytest.mark.parametrize("goal", [(1.2, 0.3, 0.5 * math.pi), (-0.5, 0.4, None)], ids=["turned", "missed"])
def test_smallest_tolerance_needs_no_second_approach(goal: tuple[float, float, float | None]) -> None:
    """The rotation moves the robot out of the tolerance; a goal just missed is behind it."""
    x_m, y_m, theta_rad = goal
    wanted = Goal(x_m=x_m, y_m=y_m, theta_rad=theta_rad, tolerance_m=0.02)
    run = drive(ROOM, Pose2(), wanted, AREA, conditions=Conditions(known_start=True))
    assert_arrived(run, 0.04)
    assert run.length_m < math.hypot(x_m, y_m) + 0.15  # a second approach would add 0.4 m or more


@pytest.mark.slow
def test_wide_tolerance_of_the_thesis() -> None:
    start, (x_m, y_m) = ROUND_BOX
    run = drive(BOX_ROOM, start, Goal(x_m=x_m, y_m=y_m, tolerance_m=0.4), AREA)
    assert_arrived(run, 0.4)


def test_enclosed_goal_fails_with_a_reason() -> None:
    """A hut without a door round the goal: once seen, it leaves no path."""
    closed = ROOM.with_boxes(box(0.0, 0.0, 0.8, 0.8))
    run = drive(closed, STRAIGHT[0], Goal(x_m=0.0, y_m=0.0), AREA, limit_s=120.0)
    assert run.state is NavigationState.FAILED
    assert "no path to the goal (0.00, 0.00)" in run.reason
    assert run.clearance_m > 0.0


def test_goal_inside_an_obstacle_fails_with_a_reason() -> None:
    """The goal is in the middle of a post."""
    world = ROOM.with_boxes(box(0.5, 0.0, 0.2, 0.2))
    run = drive(world, STRAIGHT[0], Goal(x_m=0.5, y_m=0.0), AREA, limit_s=120.0)
    assert run.state is NavigationState.FAILED
    assert "obstacle" in run.reason


def appearing(at_s: float, obstacle: list[list[float]]) -> Callable[[float], KinematicWorld]:
    blocked = ROOM.with_boxes(obstacle)
    return lambda time_s: blocked if time_s >= at_s else ROOM


@pytest.mark.parametrize("x_m", [0.55, 0.75])
def test_stops_for_a_wall_that_appears(x_m: float) -> None:
    """A wall from side to side appears ahead at full speed: no contact, and finally a reason."""
    options = NavigationOptions(recovery=RecoveryOptions(behaviours=()))
    wall = box(x_m - 0.05, 0.0, 0.1, 3.8)
    start, (goal_x_m, goal_y_m) = STRAIGHT
    run = drive(appearing(1.5, wall), start, Goal(x_m=goal_x_m, y_m=goal_y_m), AREA, options=options)
    assert run.clearance_m > 0.0
    assert run.state is NavigationState.FAILED
    assert "no path" in run.reason


def test_drives_round_a_box_that_appears() -> None:
    start, (x_m, y_m) = STRAIGHT
    run = drive(appearing(1.5, box(0.5, 0.05, 0.3, 0.3)), start, Goal(x_m=x_m, y_m=y_m), AREA)
    assert_arrived(run)


@pytest.mark.parametrize("width_m", [0.42, pytest.param(0.8, marks=pytest.mark.slow)])
def test_leaves_a_dead_end(width_m: float) -> None:
    """A robot with a short range drives into a dead end; the narrow one leaves no room to turn."""
    side = 0.5 * width_m + 0.05
    alley = ROOM.with_boxes(
        box(0.3, side, 1.2, 0.1), box(0.3, -side, 1.2, 0.1), box(-0.35, 0.0, 0.1, width_m + 0.2)
    )
    start = Pose2(x_m=1.7, y_m=0.0, theta_rad=math.pi)
    short_sighted = Conditions(range_max_m=0.8)
    run = drive(alley, start, Goal(x_m=-1.0, y_m=0.0), AREA, limit_s=120.0, conditions=short_sighted)
    assert min(pose.x_m for pose in run.track[:100]) < 0.7  # it was inside
    assert_arrived(run)
