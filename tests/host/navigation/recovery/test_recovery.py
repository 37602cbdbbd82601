"""Recoveries in move_base's order, their transitions, and that nothing retries for ever."""

import dataclasses
import logging
import math

import numpy as np
import pytest

from tests.variants import some_of
from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.goal_validation import footprint_fits
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.recovery import recovery_policy
from thumper.navigation.recovery.behaviors import DEFAULT_BEHAVIOURS, Behaviour, RecoveryOptions
from thumper.navigation.recovery.reachability import Reachability
from thumper.navigation.state import Transition, TransitionLog
from thumper_hil.kinematic.closed_loop import Run, drive
from thumper_hil.kinematic.world import KinematicWorld, box

ROOM = box(0.8, 0.0, 4.8, 3.8)
AREA = (-4.2, -5.0, 10.0, 10.0)
START = Pose2(x_m=1.73, theta_rad=math.pi)
NO_HITS = np.empty((0, 2))


def walled_in() -> OccupancyGrid:
    """Return free space with walls on all sides of a goal at (1.5, 0)."""
    cells = np.zeros((120, 120), np.int8)
    cells[50:71, 80] = cells[50:71, 100] = cells[50, 80:101] = cells[70, 80:101] = 100
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0)


def still_open() -> OccupancyGrid:
    """Return the same place without the walls."""
    return dataclasses.replace(walled_in(), cells=np.zeros((120, 120), np.int8))


def run_to_the_end(
    navigator: Navigator, grid: OccupancyGrid, *, first: OccupancyGrid | None = None, limit_s: float = 120.0
) -> float:
    """Drive an ideal robot; return the time at which the navigator failed."""
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


def test_the_log_of_a_transition_without_a_reason_has_no_colon_at_its_end(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.INFO, "thumper.navigation.state"):
        for state, reason in (("controlling", ""), ("failed", "no path")):
            TransitionLog().record(1.0, state, reason, "")
    assert caplog.messages == ["1.0 s: start -> controlling", "1.0 s: start -> failed: no path"]


def test_recoveries_run_in_order_and_every_one_is_a_transition() -> None:
    heard: list[Transition] = []
    navigator = Navigator(NavigationOptions(), Footprint(), on_transition=heard.append)
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    ended_s = run_to_the_end(navigator, walled_in(), first=still_open())
    assert tuple(heard) == navigator.transitions
    begun = [entry.reason.split(",")[0] for entry in heard if entry.after == "recovering"]
    assert begun == [
        "forgetting obstacles beyond 0.5 m",
        "rotating in place",
        "forgetting obstacles beyond 0.3 m",
        "rotating in place",
        "backing up",
        "waiting for the path to clear",
    ]
    assert all(
        "because no path to the goal (1.50, 0.00)" in e.reason for e in heard if e.after == "recovering"
    )
    assert (heard[-1].before, heard[-1].after) == ("navigating", "failed")
    assert heard[-1].reason.startswith("gave up after 6 recoveries: no path to the goal (1.50, 0.00)")
    assert [e.time_s for e in heard] == sorted(e.time_s for e in heard)
    assert heard[-1].time_s == pytest.approx(ended_s)
    assert ended_s < 40.0


def test_goal_that_was_never_reachable_gets_one_rotation() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    for goal in (Goal(x_m=1.5, y_m=0.0), Goal(x_m=1.4, y_m=0.1)):  # the second starts from scratch
        navigator.set_goal(goal)
        assert run_to_the_end(navigator, walled_in()) < 7.0
        begun = [entry.reason.split(",")[0] for entry in navigator.transitions if entry.after == "recovering"]
        assert begun == ["rotating in place"] * len(begun)
        assert navigator.transitions[-1].reason == (
            f"gave up after 1 recovery: no path to the goal {goal}: it is shut off by obstacles"
        )


def test_goal_beyond_unknown_space_is_not_aborted_before_walls_are_seen() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    hidden = walled_in()
    hidden.cells[:, 75:] = -1
    output = navigator.update(0.0, Pose2(), Twist2(), hidden, NO_HITS)
    assert len(output.plan)
    assert output.command.v_m_s > 0.0
    assert run_to_the_end(navigator, walled_in()) < 8.5  # once they are


def test_blocked_door_stays_blocked_while_out_of_view() -> None:
    """Two doors; a chair that only the scan sees blocks the nearer one."""
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


def test_remembered_free_space_survives_a_map_that_grows_and_shrinks() -> None:
    """The map's corner moves by whole cells; the door at (1, 0) has closed in the meantime."""

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
        once_open, never_open = (
            Reachability(AStarPlanner(TraversalCostOptions()), Footprint()) for _ in range(2)
        )
        once_open.update(0.0, room(-1.0, shut=False))
        assert not once_open.is_unreachable(room(x_m, shut=True), start, goal)
        never_open.update(0.0, room(-1.0, shut=True))
        assert never_open.is_unreachable(room(x_m, shut=True), start, goal)


def test_recovery_stopped_by_the_monitor_stays_one_transition() -> None:
    """Points that only the scan sees surround the footprint: the monitor rejects every motion."""
    navigator = Navigator(NavigationOptions(recovery=RecoveryOptions(behaviours=("wait",))), Footprint())
    navigator.set_goal(Goal(x_m=2.0, y_m=0.0))
    outline_m = Footprint().grown(0.015).outline_m(0.02)
    for cycle in range(60):
        grid = walled_in() if cycle else still_open()  # a path that was free may come back: it waits
        navigator.update(0.1 * cycle, Pose2(), Twist2(), grid, outline_m)
    begun = [entry for entry in navigator.transitions if entry.after == "recovering"]
    assert [entry.reason.split(", because")[0] for entry in begun] == ["waiting for the path to clear"]


@pytest.mark.parametrize("behaviours", [(), ("rotate",), ("wait", "conservative_reset")])
def test_options_set_the_recoveries(behaviours: tuple[Behaviour, ...]) -> None:
    options = NavigationOptions(recovery=RecoveryOptions(behaviours=behaviours))
    navigator = Navigator(options, Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    ended_s = run_to_the_end(navigator, walled_in(), first=still_open())
    states = [entry.after for entry in navigator.transitions]
    assert states.count("recovering") == len(behaviours)
    assert ended_s < 4.0 + 8.0 * len(behaviours)


def test_backs_up_if_there_is_no_room_to_rotate() -> None:
    """Walls 0.20 m from the centre on both sides: a rotation would hit them."""
    grid = walled_in()
    grid.cells[55, 40:75] = grid.cells[64, 40:75] = 100
    options = NavigationOptions(recovery=RecoveryOptions(behaviours=("rotate",)))
    navigator = Navigator(options, Footprint())
    navigator.set_goal(Goal(x_m=1.5, y_m=0.0))
    run_to_the_end(navigator, grid)
    begun = [entry.reason for entry in navigator.transitions if entry.after == "recovering"]
    assert [reason.split(",")[0] for reason in begun] == ["backing up"]


def test_failing_listener_does_not_stop_the_robot() -> None:
    def broken(_entry: Transition) -> None:
        raise RuntimeError("nobody is listening")

    navigator = Navigator(NavigationOptions(), Footprint(), on_transition=broken)
    navigator.set_goal(Goal(x_m=0.5, y_m=0.0))
    output = navigator.update(0.0, Pose2(), Twist2(), walled_in(), NO_HITS)
    assert output.state is NavigationState.NAVIGATING
    assert output.command.v_m_s > 0.0


def still(navigator: Navigator, time_s: float, *, lost: str = "") -> NavigationOutput:
    return navigator.update(time_s, Pose2(), Twist2(), walled_in(), NO_HITS, lost=lost)


def test_frozen_odometry_ends_the_drive_with_a_reason() -> None:
    """The wheels are commanded to turn, but neither speed nor pose ever changes."""
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=0.5, y_m=0.0))
    for cycle in range(100):
        output = still(navigator, 0.1 * cycle)
        if output.state is NavigationState.FAILED:
            break
    assert output.state is NavigationState.FAILED
    assert "the odometry has not moved for 3 s although the wheels were commanded to turn" in output.reason
    assert output.command == Twist2()
    assert 3.0 < 0.1 * cycle < 4.0


def test_lost_pose_stops_the_robot_at_once_and_ends_the_drive() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=0.5, y_m=0.0))
    assert still(navigator, 0.0).command.v_m_s > 0.0
    stopped = still(navigator, 0.1, lost="the scan fits nowhere")
    assert (stopped.command, stopped.state) == (Twist2(), NavigationState.NAVIGATING)
    assert stopped.reason == "stopped until the pose is known again: the scan fits nowhere"
    assert still(navigator, 5.0, lost="the scan fits nowhere").command == Twist2()
    assert still(navigator, 5.1).command.v_m_s > 0.0  # relocalized: drives on
    for cycle in range(111):
        output = still(navigator, 6.0 + 0.1 * cycle, lost="the scan fits nowhere")
        assert output.command == Twist2()
    assert output.state is NavigationState.FAILED
    assert output.reason == "the robot's pose is lost: the scan fits nowhere"


def test_robot_at_its_goal_is_not_lost() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=0.02, y_m=0.0))
    assert still(navigator, 0.0).state is NavigationState.REACHED
    assert still(navigator, 60.0, lost="lifted").state is NavigationState.REACHED


def drive_to_hut(side_m: float, seed: int) -> Run:
    """Drive to a goal inside a hut without a door, which the robot discovers as it drives."""
    room = box(0.8, 0.0, max(4.8, side_m + 5.0), max(3.8, side_m + 4.0))
    world = KinematicWorld.from_boxes(room, box(0.0, 0.0, side_m, side_m))
    start = Pose2(x_m=0.5 * side_m + 1.0, theta_rad=math.pi)
    return drive(world, start, Goal(x_m=0.0, y_m=0.0), AREA, seed=seed, limit_s=150.0)


@pytest.mark.parametrize(
    ("side_m", "seed", "max_s"), [(0.8, 0, 60.0), pytest.param(1.8, 1, 110.0, marks=pytest.mark.slow)]
)
def test_unreachable_goal_fails_soon(side_m: float, seed: int, max_s: float) -> None:
    """Even if the robot first drives round the whole hut in search of a door."""
    run = drive_to_hut(side_m, seed)
    assert run.state is NavigationState.FAILED
    assert "gave up" in run.reason
    assert run.time_s < max_s
    assert run.clearance_m > 0.0


def test_reason_names_a_goal_without_room() -> None:
    """Between four posts there is room for the robot's centre, but not for its outline."""
    cells = np.zeros((120, 120), np.int8)
    cells[[57, 63, 60, 60], [88, 88, 85, 91]] = 100  # 0.15 m from the goal
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0)
    costmap = build_costmap(grid, NO_HITS, Footprint(), CostmapOptions())
    goal = Goal(x_m=1.425, y_m=0.025, tolerance_m=0.05)
    assert not footprint_fits(costmap, Footprint(), goal)
    assert footprint_fits(costmap, Footprint(), dataclasses.replace(goal, x_m=0.9))
    assert footprint_fits(costmap, Footprint(), dataclasses.replace(goal, tolerance_m=0.6))
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(goal)
    run_to_the_end(navigator, grid)
    assert navigator.transitions[-1].reason.endswith("; there is no room for the robot at the goal")


def test_blocked_corridor_fails_after_all_recoveries() -> None:
    """A wall appears ahead for good, and there is no way round it."""
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
    assert "no path" in run.reason
    assert run.clearance_m > 0.0
    assert run.time_s < 70.0


def test_default_recoveries_are_in_move_bases_order() -> None:
    assert DEFAULT_BEHAVIOURS[:4] == ("conservative_reset", "rotate", "aggressive_reset", "rotate")
    assert RecoveryOptions().behaviours == DEFAULT_BEHAVIOURS


def drive_near_wall(goal: Goal, seed: int) -> Run:
    """Drive to a goal beside the west wall of the room, at x = -1.6 m."""
    return drive(KinematicWorld.from_boxes(ROOM), START, goal, AREA, seed=seed, limit_s=100.0)


@pytest.mark.parametrize("seed", some_of([0, 1]))
def test_stationary_within_the_tolerance_is_reached(seed: int) -> None:
    run = drive_near_wall(Goal(x_m=-1.55, y_m=0.3, tolerance_m=0.3), seed)
    assert run.state is NavigationState.REACHED
    assert [transition.after for transition in run.transitions] == ["navigating", "reached"]  # not stuck
    assert run.time_s < 20.0
    assert run.clearance_m > 0.0


def test_goal_too_near_a_wall_for_the_outline_is_aborted_early() -> None:
    """The inscribed circle fits within the tolerance, the outline does not: it drives there first."""
    run = drive_near_wall(Goal(x_m=-1.55, y_m=0.3), 0)
    assert run.state is NavigationState.FAILED
    assert "no room for the robot at the goal" in run.outputs[-1].reason
    assert run.time_s < 30.0  # with all recoveries 75 s
    assert run.clearance_m > 0.0


def test_room_at_the_goal_is_checked_once_per_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that stands asks in every cycle."""
    cells = np.zeros((160, 160), np.int8)
    cells[:40] = 100
    grid = OccupancyGrid(cells=cells, resolution_m=0.025, origin_x_m=-2.0, origin_y_m=-2.0)
    goal = Goal(x_m=0.0, y_m=-0.95, theta_rad=-0.5 * math.pi)
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(goal)
    checks: list[Goal] = []

    def counted(costmap: Costmap, footprint: Footprint, goal: Goal) -> bool:
        checks.append(goal)
        return footprint_fits(costmap, footprint, goal)

    monkeypatch.setattr(recovery_policy, "footprint_fits", counted)
    pose = Pose2(y_m=-0.7, theta_rad=-0.5 * math.pi)
    for cycle in range(60):
        if navigator.update(0.1 * cycle, pose, Twist2(), grid, NO_HITS).state is NavigationState.FAILED:
            break
    assert len(checks) == 2  # for the verdict and for its text
