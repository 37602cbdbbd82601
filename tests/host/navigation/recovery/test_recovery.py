"""The recovery ladder in move_base's order, what is told of it, and that nothing retries for ever."""

import dataclasses
import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarOptions, AStarPlanner
from thumper.navigation.planners.goal_validation import has_room
from thumper.navigation.recovery.behaviors import LADDER, Behaviour, RecoveryOptions
from thumper.navigation.recovery.reachability import Reachability
from thumper.navigation.state import Transition
from thumper_hil.kinematic.closed_loop import Run, drive
from thumper_hil.kinematic.world import KinematicWorld, box

ROOM = box(0.8, 0.0, 4.8, 3.8)
AREA = (-4.2, -5.0, 10.0, 10.0)
START = Pose2(x_m=1.73, theta_rad=math.pi)
NO_HITS = np.empty((0, 2))


def walled_in() -> OccupancyGrid:
    """Free ground, and a goal at (1.5, 0) behind walls on all sides."""
    cells = np.zeros((120, 120), np.int8)
    cells[50:71, 80] = cells[50:71, 100] = cells[50, 80:101] = cells[70, 80:101] = 100
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0)


def still_open() -> OccupancyGrid:
    """The same place before the walls stood there."""
    return dataclasses.replace(walled_in(), cells=np.zeros((120, 120), np.int8))


def run_to_the_end(
    navigator: Navigator, grid: OccupancyGrid, *, first: OccupancyGrid | None = None, limit_s: float = 120.0
) -> float:
    """Let an ideal robot follow; return the time at which the navigator failed."""
    pose, twist = Pose2(), Twist2()
    for cycle in range(round(10.0 * limit_s)):
        now = first if first is not None and cycle == 0 else grid
        output = navigator.update(0.1 * cycle, pose, twist, now, NO_HITS)
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
    ended_s = run_to_the_end(navigator, walled_in(), first=still_open())
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


def test_where_no_way_was_ever_open_a_look_round_is_all_that_is_tried() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    for goal in (Goal(x_m=1.5, y_m=0.0), Goal(x_m=1.4, y_m=0.1)):  # the second begins afresh
        navigator.set_goal(goal)
        assert run_to_the_end(navigator, walled_in()) < 7.0
        begun = [entry.reason.split(",")[0] for entry in navigator.transitions if entry.after == "recovering"]
        assert begun == ["turning to look round"] * len(begun)
        assert navigator.transitions[-1].reason == (
            f"gave up after 1 recovery: no way to the goal {goal}: it is shut off by obstacles"
        )


def test_a_goal_beyond_the_unknown_is_not_given_up_before_the_walls_are_seen() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    hidden = walled_in()
    hidden.cells[:, 75:] = -1
    output = navigator.update(0.0, Pose2(), Twist2(), hidden, NO_HITS)
    assert len(output.plan)
    assert output.command.v_m_s > 0.0
    assert run_to_the_end(navigator, walled_in()) < 8.5  # once they are


def test_a_way_seen_shut_is_not_taken_up_again_while_the_robot_looks_away() -> None:
    """Two doors; the nearer one is shut by a chair that only the scan knows."""
    cells = np.zeros((120, 120), np.int8)
    cells[:, 100] = 100
    cells[50:62, 100] = cells[100:112, 100] = 0
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0)
    chair = np.column_stack((np.full(40, 2.0), np.linspace(-0.6, 0.2, 40)))
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=2.5, y_m=-0.2))
    facing = navigator.update(0.0, Pose2(), Twist2(), grid, chair)
    assert facing.plan[:, 1].max() > 1.5
    for cycle in range(1, 20):
        turned = Pose2(theta_rad=math.pi)
        output = navigator.update(0.1 * cycle, turned, Twist2(), grid, NO_HITS)
        assert output.plan[:, 1].max() > 1.5


def test_what_was_open_stays_so_on_a_map_that_grows_and_shrinks() -> None:
    """Its frame's corner moves by whole cells; the door at (1, 0) has shut meanwhile."""

    def room(x_m: float, *, shut: bool) -> Costmap:
        cells = np.zeros((60, 80), np.int8)
        door = round((1.0 - x_m) / 0.05)
        cells[:, door] = 100
        if not shut:
            cells[24:36, door] = 0
        grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=x_m, origin_y_m=-1.5)
        return build_costmap(grid, NO_HITS, Footprint(), CostmapOptions())

    goal, start = Goal(x_m=1.6, y_m=0.0), Pose2(x_m=0.3)
    for x_m in (-1.0, -1.5, -0.5):
        prospects = Reachability(AStarPlanner(AStarOptions()), Footprint())
        prospects.note(0.0, room(-1.0, shut=False))
        assert not prospects.are_none(room(x_m, shut=True), start, goal)
        prospects.reset()
        prospects.note(0.0, room(-1.0, shut=True))
        assert prospects.are_none(room(x_m, shut=True), start, goal)


def test_a_recovery_that_the_monitor_stops_is_still_told_as_that_recovery() -> None:
    """Points that only the scan knows lie round the hull: whatever is tried, the monitor objects."""
    navigator = Navigator(NavigationOptions(recovery=RecoveryOptions(behaviours=("wait",))), Footprint())
    navigator.set_goal(Goal(x_m=2.0, y_m=0.0))
    hull_m = Footprint().grown(0.015).outline_m(0.02)
    for cycle in range(60):
        grid = walled_in() if cycle else still_open()  # a way that was open may come back: it waits
        navigator.update(0.1 * cycle, Pose2(), Twist2(), grid, hull_m)
    begun = [entry for entry in navigator.transitions if entry.after == "recovering"]
    assert [entry.reason.split(", because")[0] for entry in begun] == ["waiting for the way to clear"]


@pytest.mark.parametrize("behaviours", [(), ("rotate",), ("wait", "conservative_reset")])
def test_the_ladder_is_the_one_of_the_options(behaviours: tuple[Behaviour, ...]) -> None:
    options = NavigationOptions(recovery=RecoveryOptions(behaviours=behaviours))
    navigator = Navigator(options, Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    ended_s = run_to_the_end(navigator, walled_in(), first=still_open())
    states = [entry.after for entry in navigator.transitions]
    assert states.count("recovering") == len(behaviours)
    assert ended_s < 4.0 + 8.0 * len(behaviours)


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
    world = KinematicWorld.from_boxes(room, box(0.0, 0.0, side_m, side_m))
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


def test_a_goal_without_room_is_told_from_a_way_that_was_not_found() -> None:
    """Between four posts the robot's centre may lie, but its outline fits under no heading."""
    cells = np.zeros((120, 120), np.int8)
    cells[[57, 63, 60, 60], [88, 88, 85, 91]] = 100  # 0.15 m from the goal
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0)
    costmap = build_costmap(grid, NO_HITS, Footprint(), CostmapOptions())
    goal = Goal(x_m=1.425, y_m=0.025, tolerance_m=0.05)
    assert not has_room(costmap, Footprint(), goal)
    assert has_room(costmap, Footprint(), dataclasses.replace(goal, x_m=0.9))
    assert has_room(costmap, Footprint(), dataclasses.replace(goal, tolerance_m=0.6))
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(goal)
    run_to_the_end(navigator, grid)
    assert navigator.transitions[-1].reason.endswith("; there is no room for the robot at the goal")


def test_a_corridor_shut_behind_and_ahead_fails_with_the_whole_ladder() -> None:
    """Blocked for good: walls appear ahead, no way round."""
    hall, wall = KinematicWorld.from_boxes(box(2.0, 0.0, 7.0, 1.4)), box(2.5, 0.0, 0.1, 1.6)
    shut = hall.with_boxes(wall)
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


def drive_near_wall(goal: Goal, seed: int) -> Run:
    """To a goal beside the west wall of the room, at x = -1.6 m."""
    return drive(KinematicWorld.from_boxes(ROOM), START, goal, AREA, seed=seed, limit_s=100.0)


@pytest.mark.parametrize("seed", [0, 1])
def test_as_near_as_it_gets_is_near_enough_within_the_tolerance(seed: int) -> None:
    run = drive_near_wall(Goal(x_m=-1.55, y_m=0.3, tolerance_m=0.3), seed)
    assert run.state is NavigationState.REACHED
    assert run.time_s < 15.0  # 11 s; standing out the patience of a stuck robot it was 18 ... 20 s
    assert run.clearance_m > 0.0


def test_a_goal_too_near_a_wall_for_the_outline_is_given_up_where_that_is_seen() -> None:
    """The inscribed circle fits within the tolerance, the outline under no heading: it drives there first."""
    run = drive_near_wall(Goal(x_m=-1.55, y_m=0.3), 0)
    assert run.state is NavigationState.FAILED
    assert "no room for the robot at the goal" in run.outputs[-1].reason
    assert run.time_s < 20.0  # 11 s; by the ladder it was 75 s
    assert run.clearance_m > 0.0
