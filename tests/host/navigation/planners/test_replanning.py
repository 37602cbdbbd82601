"""When the path manager keeps its path and when it takes another: two doors in a wall, left and right."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.costmap.inflation import INSCRIBED
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.polyline import resample
from thumper.navigation.planners.replanning import (
    BLOCKED_S,
    MAX_KEPT_S,
    NARROW_S,
    PathManager,
    ReplanningOptions,
)
from thumper.navigation.planners.traversal_cost import TraversalCostOptions

ROBOT, GOAL = Pose2(x_m=3.1, y_m=1.0), Goal(x_m=3.1, y_m=5.0)
PERIOD_S = 0.1


def doors(
    *, left_open: bool = True, right_open: bool = True, posts: tuple[tuple[int, int], ...] = ()
) -> Costmap:
    """Return a wall at y = 3 m between robot and goal, with doors at x = 2 m and, a little nearer, 4 m.

    `posts` are occupied cells, as row and column.
    """
    cells = np.zeros((120, 120), np.int8)
    for post in posts:
        cells[post] = 100
    cells[60] = 100
    if left_open:
        cells[60, 30:50] = 0
    if right_open:
        cells[60, 70:90] = 0
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    return build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())


def door_after(
    manager: PathManager, begin_s: float, seconds: float, costmap: Costmap, robot: Pose2, goal: Goal
) -> str:
    """Return the door that the path leads through after some seconds with a costmap."""
    for cycle in range(round(seconds / PERIOD_S)):
        manager.update(begin_s + cycle * PERIOD_S, costmap, robot, goal)
    assert manager.path_m is not None
    crossing = np.argmin(np.abs(manager.path_m[:, 1] - 3.0))
    return "left" if manager.path_m[crossing, 0] < 3.0 else "right"


class Drive:
    """A robot at rest whose costmap changes; each `cycles` runs the manager for some cycles."""

    def __init__(self) -> None:
        self._manager = PathManager(AStarPlanner(TraversalCostOptions()), ReplanningOptions(), Footprint())
        self._time_s = 0.0

    def cycles(self, count: int, costmap: Costmap) -> str:
        """Return the door that the path leads through after `count` cycles."""
        door = door_after(self._manager, self._time_s, count * PERIOD_S, costmap, ROBOT, GOAL)
        self._time_s += count * PERIOD_S
        return door


def test_a_door_that_closes_for_some_scans_keeps_its_path() -> None:
    drive = Drive()
    assert drive.cycles(1, doors()) == "right"
    for _ in range(10):
        assert drive.cycles(round(BLOCKED_S / PERIOD_S) - 1, doors(right_open=False)) == "right"
        assert drive.cycles(1, doors()) == "right"


def test_a_door_that_stays_closed_loses_its_path_and_does_not_get_it_back_at_once() -> None:
    drive = Drive()
    assert drive.cycles(1, doors()) == "right"
    assert drive.cycles(round(BLOCKED_S / PERIOD_S) + 1, doors(right_open=False)) == "left"
    # The right door is cheaper by little: when it opens again the robot goes on to the left one.
    assert drive.cycles(100, doors()) == "left"


def test_a_narrow_path_gets_more_time_and_a_cheaper_one_must_stay_cheaper() -> None:
    """The robot is right before a door, the detour through the other one is far longer."""
    manager = PathManager(AStarPlanner(TraversalCostOptions()), ReplanningOptions(), Footprint())
    robot, goal = Pose2(x_m=4.0, y_m=2.2), Goal(x_m=4.0, y_m=3.9)
    narrow = doors()
    narrow_m = narrow.resolution_m * math.sqrt(8.0)
    assert 0.5 * Footprint().inscribed_radius_m < narrow_m <= Footprint().inscribed_radius_m
    narrow.costs[60, 70:90], narrow.squared_cells[60, 70:90] = INSCRIBED, 8
    time_s, found = 0.0, []
    for costmap, seconds in ((doors(), 0.1), (narrow, NARROW_S - 0.2), (doors(right_open=False), 1.0)):
        found.append(door_after(manager, time_s, seconds, costmap, robot, goal))
        time_s += seconds
    assert found == ["right", "right", "left"]
    assert door_after(manager, time_s, 1.5, doors(), robot, goal) == "left"
    assert door_after(manager, time_s + 1.5, 5.0, doors(), robot, goal) == "right"


@pytest.mark.parametrize(
    ("robot", "goal", "kept_s", "lost_s"),
    [
        (ROBOT, GOAL, 0.2, 1.2),
        (Pose2(x_m=4.0, y_m=2.2), Goal(x_m=4.0, y_m=3.9), MAX_KEPT_S - 0.3, MAX_KEPT_S + 0.5),
    ],
)
def test_while_something_moves_the_robot_waits_as_long_as_the_detour_takes(
    robot: Pose2, goal: Goal, kept_s: float, lost_s: float
) -> None:
    """Seen from ROBOT the way through the other door is a few centimetres longer, right before a door far."""
    manager = PathManager(AStarPlanner(TraversalCostOptions()), ReplanningOptions(), Footprint())
    manager.keeps = False
    closed = doors(right_open=False)
    assert door_after(manager, 0.0, PERIOD_S, doors(), robot, goal) == "right"
    assert door_after(manager, PERIOD_S, kept_s, closed, robot, goal) == "right"
    assert door_after(manager, PERIOD_S + kept_s, lost_s - kept_s, closed, robot, goal) == "left"


def test_a_cheaper_path_on_the_same_side_is_taken_at_once() -> None:
    """A path with a detour, found before the robot has seen the hall, is not driven to its end."""
    manager = PathManager(AStarPlanner(TraversalCostOptions()), ReplanningOptions(), Footprint())
    robot, goal = Pose2(x_m=3.0, y_m=1.0), Goal(x_m=5.0, y_m=1.0)
    detour_m = np.array(((3.0, 1.0), (4.0, 2.2), (5.0, 1.0)))
    manager.path_m = resample(detour_m, 0.05)
    manager.update(0.0, doors(), robot, goal)
    assert manager.path_m[:, 1].max() < 1.1


@pytest.mark.parametrize(("posts", "door"), [((), "right"), (((46, 66), (54, 66)), "left")])
def test_a_cheaper_path_behind_the_robot_needs_room_to_turn(
    posts: tuple[tuple[int, int], ...], door: str
) -> None:
    """The robot drives to the left door; the right one, behind it, opens. Posts stand 0.2 m beside it."""
    manager = PathManager(AStarPlanner(TraversalCostOptions()), ReplanningOptions(), Footprint())
    robot, goal = Pose2(x_m=3.325, y_m=2.525, theta_rad=math.pi), Goal(x_m=5.0, y_m=3.9)
    closed, opened = doors(right_open=False, posts=posts), doors(posts=posts)
    assert door_after(manager, 0.0, 0.1, closed, robot, goal) == "left"
    assert door_after(manager, 0.1, 5.0, opened, robot, goal) == door


def test_a_gap_that_may_only_look_too_narrow_is_tried_if_there_is_no_other_way() -> None:
    """Seven cells of 5 cm: the middle is 4 cells from the walls' cells, 3 cells beside it."""
    planner = AStarPlanner(TraversalCostOptions())
    wide = Footprint.rectangle(length_m=0.42, width_m=0.42)
    for gap, found in ((7, True), (5, False)):
        cells = np.zeros((120, 120), np.int8)
        cells[60] = 100
        cells[60, 60 : 60 + gap] = 0
        grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
        costmap = build_costmap(grid, np.empty((0, 2)), wide, CostmapOptions())
        assert planner.plan(costmap, ROBOT, GOAL).path_m is None
        manager = PathManager(planner, ReplanningOptions(), wide)
        for cycle in range(5):
            manager.update(cycle * PERIOD_S, costmap, ROBOT, GOAL)
        assert (manager.path_m is not None) == found
