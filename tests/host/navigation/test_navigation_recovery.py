"""The recovery ladder in move_base's order, what is told of it, and that nothing retries for ever."""

import math

import numpy as np
import pytest

from thumper.geometry import Pose2, Twist2
from thumper.mapping.grid import OccupancyGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.recovery import LADDER, Behaviour, RecoveryOptions
from thumper.navigation.transitions import Transition
from thumper_hil.arena.closed_loop import Run, drive
from thumper_hil.arena.world import World, box

ROOM = box(0.8, 0.0, 4.8, 3.8)
AREA = (-4.2, -5.0, 10.0, 10.0)
START = Pose2(x_m=1.73, theta_rad=math.pi)
NO_HITS = np.empty((0, 2))


def walled_in() -> OccupancyGrid:
    """Free ground, and a goal at (1.5, 0) behind walls on all sides."""
    cells = np.zeros((120, 120), np.int8)
    cells[50:71, 80] = cells[50:71, 100] = cells[50, 80:101] = cells[70, 80:101] = 100
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0)


def run_to_the_end(navigator: Navigator, grid: OccupancyGrid, *, limit_s: float = 120.0) -> float:
    """Let an ideal robot follow; return the time at which the navigator failed."""
    pose, twist = Pose2(), Twist2()
    for cycle in range(round(10.0 * limit_s)):
        output = navigator.update(0.1 * cycle, pose, twist, grid, NO_HITS)
        if output.state is NavigationState.FAILED:
            assert output.command == Twist2()
            return 0.1 * cycle
        twist = output.command
        pose = pose @ Pose2(x_m=0.1 * twist.v_m_s, theta_rad=0.1 * twist.w_rad_s)
    raise AssertionError(f"still {output.state} after {limit_s} s: {output.reason}")


def test_the_ladder_is_move_bases_with_back_up_and_wait_and_every_step_is_told() -> None:
    heard: list[Transition] = []
    navigator = Navigator(NavigationOptions(), Footprint(), on_transition=heard.append)
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    ended_s = run_to_the_end(navigator, walled_in())
    assert tuple(heard) == navigator.transitions
    begun = [entry.reason.split(",")[0] for entry in heard if entry.after == "recovering"]
    assert begun == [
        "conservative reset",
        "turning to look round",
        "aggressive reset",
        "turning to look round",
        "backing up",
        "waiting for the way to clear",
    ]
    assert all(
        "because no way to the goal (1.50, 0.00)" in e.reason for e in heard if e.after == "recovering"
    )
    assert (heard[-1].before, heard[-1].after) == ("navigating", "failed")
    assert heard[-1].reason.startswith("gave up after 6 recoveries: no way to the goal (1.50, 0.00)")
    assert [e.time_s for e in heard] == sorted(e.time_s for e in heard)
    assert heard[-1].time_s == pytest.approx(ended_s)
    assert ended_s < 40.0


def test_a_recovery_that_the_monitor_stops_is_still_told_as_that_recovery() -> None:
    """Points that only the scan knows lie round the hull: whatever is tried, the monitor objects."""
    navigator = Navigator(NavigationOptions(recovery=RecoveryOptions(behaviours=("wait",))), Footprint())
    navigator.set_goal(Goal(x_m=2.0, y_m=0.0))
    hull_m = Footprint().grown(0.015).outline_m(0.02)
    for cycle in range(60):
        navigator.update(0.1 * cycle, Pose2(), Twist2(), walled_in(), hull_m)
    begun = [entry for entry in navigator.transitions if entry.after == "recovering"]
    assert [entry.reason.split(", because")[0] for entry in begun] == ["waiting for the way to clear"]


@pytest.mark.parametrize("behaviours", [(), ("rotate",), ("wait", "conservative_reset")])
def test_the_ladder_is_the_one_of_the_options(behaviours: tuple[Behaviour, ...]) -> None:
    options = NavigationOptions(recovery=RecoveryOptions(behaviours=behaviours))
    navigator = Navigator(options, Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    ended_s = run_to_the_end(navigator, walled_in())
    states = [entry.after for entry in navigator.transitions]
    assert states.count("recovering") == len(behaviours)
    assert ended_s < 3.0 + 8.0 * len(behaviours)


def test_a_place_too_tight_to_turn_is_left_backward() -> None:
    """Walls 0.15 m from the centre on both sides: a rotation would hit them."""
    grid = walled_in()
    grid.cells[56, 40:75] = grid.cells[63, 40:75] = 100
    options = NavigationOptions(recovery=RecoveryOptions(behaviours=("rotate",)))
    navigator = Navigator(options, Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    run_to_the_end(navigator, grid)
    begun = [entry.reason for entry in navigator.transitions if entry.after == "recovering"]
    assert [reason.split(",")[0] for reason in begun] == ["backing up"]


def test_a_listener_that_fails_does_not_stop_the_robot() -> None:
    def broken(_entry: Transition) -> None:
        raise RuntimeError("nobody is listening")

    navigator = Navigator(NavigationOptions(), Footprint(), on_transition=broken)
    navigator.set_goal(Goal(x_m=0.5, y_m=0.0))
    output = navigator.update(0.0, Pose2(), Twist2(), walled_in(), NO_HITS)
    assert output.state is NavigationState.NAVIGATING
    assert output.command.v_m_s > 0.0


def still(navigator: Navigator, time_s: float, *, lost: str = "") -> NavigationOutput:
    return navigator.update(time_s, Pose2(), Twist2(), walled_in(), NO_HITS, lost=lost)


def test_frozen_odometry_ends_the_drive_in_words() -> None:
    """The wheels are told to turn and neither speed nor pose ever changes."""
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=0.5, y_m=0.0))
    for cycle in range(100):
        output = still(navigator, 0.1 * cycle)
        if output.state is NavigationState.FAILED:
            break
    assert output.state is NavigationState.FAILED
    assert "the odometry has not moved for 3 s although the wheels were told to turn" in output.reason
    assert output.command == Twist2()
    assert 3.0 < 0.1 * cycle < 4.0


def test_a_lost_position_stops_the_robot_at_once_and_ends_the_drive() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=0.5, y_m=0.0))
    assert still(navigator, 0.0).command.v_m_s > 0.0
    stopped = still(navigator, 0.1, lost="the scan fits nowhere")
    assert (stopped.command, stopped.state) == (Twist2(), NavigationState.NAVIGATING)
    assert stopped.reason == "standing until the position is known again: the scan fits nowhere"
    assert still(navigator, 5.0, lost="the scan fits nowhere").command == Twist2()
    assert still(navigator, 5.1).command.v_m_s > 0.0  # found again: goes on
    for cycle in range(111):
        output = still(navigator, 6.0 + 0.1 * cycle, lost="the scan fits nowhere")
        assert output.command == Twist2()
    assert output.state is NavigationState.FAILED
    assert output.reason == "the robot does not know where it is: the scan fits nowhere"


def test_a_robot_at_its_goal_is_not_lost() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=0.02, y_m=0.0))
    assert still(navigator, 0.0).state is NavigationState.REACHED
    assert still(navigator, 60.0, lost="lifted").state is NavigationState.REACHED


def drive_to_hut(side_m: float, seed: int) -> Run:
    """To a goal inside a hut without a door, which the robot learns of on the way."""
    room = box(0.8, 0.0, max(4.8, side_m + 5.0), max(3.8, side_m + 4.0))
    world = World.of(room, box(0.0, 0.0, side_m, side_m))
    start = Pose2(x_m=0.5 * side_m + 1.0, theta_rad=math.pi)
    return drive(world, start, Goal(x_m=0.0, y_m=0.0), AREA, seed=seed, limit_s=150.0)


@pytest.mark.parametrize(("side_m", "seed", "most_s"), [(0.8, 0, 60.0), (1.8, 1, 110.0)])
def test_an_unreachable_goal_fails_soon(side_m: float, seed: int, most_s: float) -> None:
    """Also when the robot first goes round the whole hut in search of a door."""
    run = drive_to_hut(side_m, seed)
    assert run.state is NavigationState.FAILED
    assert "gave up" in run.reason
    assert run.time_s < most_s
    assert run.clearance_m > 0.0


def test_a_corridor_shut_behind_and_ahead_fails_with_the_whole_ladder() -> None:
    """Blocked for good: walls appear ahead, no way round."""
    hall, wall = World.of(box(2.0, 0.0, 7.0, 1.4)), box(2.5, 0.0, 0.1, 1.6)
    shut = hall.joined(wall)
    run = drive(
        lambda time_s: shut if time_s > 1.5 else hall,
        Pose2(),
        Goal(x_m=4.5, y_m=0.0),
        AREA,
        limit_s=100.0,
    )
    assert run.state is NavigationState.FAILED
    assert "no way" in run.reason
    assert run.clearance_m > 0.0
    assert run.time_s < 70.0


def test_the_default_ladder_has_move_bases_order() -> None:
    assert LADDER[:4] == ("conservative_reset", "rotate", "aggressive_reset", "rotate")
    assert RecoveryOptions().behaviours == LADDER
