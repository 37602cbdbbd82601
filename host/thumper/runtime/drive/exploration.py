"""The task of an exploration: drive from frontier to frontier until none is left, then home.

A drive to a frontier ends as soon as the lidar has seen what is behind it: the robot then drives on to the
next frontier without a stop.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import TYPE_CHECKING

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.resumable import Search, SlicedSearch, merged
from thumper.maps.occupancy_grid import FREE, OccupancyGrid
from thumper.navigation.costmap.filters import with_keepout
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.runtime.drive.legs import AnyLeg, Leg, Wait
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.state_estimator import StateEstimator

if TYPE_CHECKING:
    from thumper.navigation.planners.frontier_exploration import Explorer, Frontier

SLICES_PER_CYCLE = 3  # of the search for the next frontier while the robot is at rest: no planner runs
LOOK_CYCLES = 5  # between two looks at whether a frontier is still one
SAME_VIEWPOINT_M = 0.3
PATIENCE_S = 10.0  # another frontier may be easier to reach, and show the rest of this one
HOME_TOLERANCE_M = 0.15
MOST_FREE_PERCENT = 50  # cells with less count as free floor in the report
NEAR_HOME_M = 0.5  # if something stands at home now
PURPOSE = "exploring"
BACK = "back at the start"
NOTHING_LEFT = "explored: no frontier is left"
MapAndPose = Callable[[], tuple[OccupancyGrid, Pose2]]


def map_to_explore(estimator: StateEstimator, navigator: Navigator) -> MapAndPose:
    """Return a function for `explore`: keep-out zones are obstacles in its map."""

    def now() -> tuple[OccupancyGrid, Pose2]:
        grid, map_from_base = estimator.map_and_pose()
        return with_keepout(grid, navigator.keepout), map_from_base

    return now


def home_at(map_from_base: Pose2) -> Goal:
    """Return the goal of the way back to a pose, with any heading."""
    return Goal(x_m=map_from_base.x_m, y_m=map_from_base.y_m, tolerance_m=HOME_TOLERANCE_M)


class _Approach:
    """Watches the drive to one frontier, and chooses the next one once this one has been seen."""

    def __init__(self, explorer: "Explorer", now: MapAndPose, frontier: "Frontier") -> None:
        self.next: Frontier | None = None
        self._explorer = explorer
        self._now = now
        self._frontier = frontier
        self._viewpoint_m = frontier.viewpoint_m
        self._search = SlicedSearch["Frontier | None"]()
        self._cycles = 0

    def has_next(self) -> bool:
        """Do one slice of work; return whether to drive on to `next`. Call it in each cycle."""
        self._cycles += 1
        if self._search.is_running:
            found = self._search.advance()
            if found is not None and math.dist(found.viewpoint_m, self._viewpoint_m) < SAME_VIEWPOINT_M:
                self._frontier = found  # the border has moved on, and is observed from the same place
            else:
                self.next = found
        elif self._cycles % LOOK_CYCLES == 0:
            grid, map_from_base = self._now()
            if self._frontier.is_seen(grid):
                self._search.start(self._explorer.search(grid, map_from_base))
        return self.next is not None


def explore(
    explorer: "Explorer",
    now: MapAndPose,
    home: Goal,
    *,
    limit_s: float,
    report: Callable[[str], None] = lambda _: None,
) -> Task:
    """Drive from frontier to frontier until none is left or `limit_s` is over, then home.

    The robot tries the frontiers that it gave up a second time when no others are left. If there is no room
    at home any more, it drives near it. `now` returns the map and the robot's pose in it. `report` receives
    a line for each frontier that is given up, and one before the way home. The result's time and path length
    are those of all drives.
    """
    result, ending = yield from _drive_to_frontiers(explorer, now, home, limit_s, report)
    report(ending)
    if result.interrupted:
        return result
    try:
        result = (yield Leg(goal=home, name="home", purpose=PURPOSE)).after(result)
        if not result.reached and result.navigation_failed and home.tolerance_m < NEAR_HOME_M:
            near = replace(home, tolerance_m=NEAR_HOME_M)
            result = (yield Leg(goal=near, name="near home", purpose=PURPOSE)).after(result)
    except ThumperError as refusal:  # keep the map that there is
        return replace(result, reached=False, reason=str(refusal))
    if not result.reached:
        return result
    return replace(result, reason=ending if ending.startswith(NOTHING_LEFT) else f"{ending}; {BACK}")


def _drive_to_frontiers(
    explorer: "Explorer",
    now: MapAndPose,
    home: Goal,
    limit_s: float,
    report: Callable[[str], None],
) -> Generator[AnyLeg, DriveResult, tuple[DriveResult, str]]:
    """Return the last result and why the exploration ended."""
    # The first drive ends where it starts: it makes the robot scan its surroundings for a first map.
    result = yield Leg(goal=home, name="initial scan", purpose=PURPOSE)
    tried, reached = 0, 0
    given_up: list[Frontier] = []
    is_second_round = False
    frontier: Frontier | None = None
    while result.time_s < limit_s and not result.interrupted:
        if frontier is None:
            frontier, result, problem = yield from _choose(explorer.search(*now()), result)
            if problem:
                return result, f"ended after {result.time_s:.0f} s: {problem}"
        if frontier is None and given_up and not is_second_round:
            is_second_round = True  # the rest of the map may show another way to them
            explorer.retry(given_up)
            given_up = []
            continue
        if frontier is None and not tried:
            return result, f"{NOTHING_LEFT}, the map has {_free_m2(now()[0]):.1f} m² of free floor"
        if frontier is None:
            why = "explored"
            break
        tried += 1
        approach, goal = _Approach(explorer, now, frontier), explorer.goal(frontier)
        try:
            drive = yield Leg(
                goal=goal,
                name=f"frontier {tried}",
                purpose=PURPOSE,
                until=approach.has_next,
                patience_s=PATIENCE_S,
            )
        except ThumperError as refusal:  # a frontier is next to free space: the robot itself cannot drive
            ending = f"ended after {result.time_s:.0f} s: {refusal}"
            return replace(result, reached=False, reason=str(refusal)), ending
        result = drive.after(result)
        reached += drive.reached
        if not drive.reached and not drive.interrupted:
            if not drive.navigation_failed:  # not the fault of the goal
                return result, f"ended after {result.time_s:.0f} s: {result.reason}"
            report(f"gave up frontier {tried} at {goal}: {result.reason}")
            given_up.append(frontier)
        if approach.next is None:
            explorer.skip(frontier)
        frontier = approach.next
    else:
        why = "interrupted" if result.interrupted else "time is up"
    ending = f"{why} after {result.time_s:.0f} s: reached {reached} of {tried} frontiers"
    if tried:  # before the first telemetry there is no map
        ending += _findings(now()[0], [explorer.goal(frontier) for frontier in given_up])
    return result, ending


def _findings(grid: OccupancyGrid, given_up: list[Goal]) -> str:
    """Return what an exploration found, and what it could not reach."""
    missing = f", could not reach {', '.join(map(str, given_up))}" if given_up else ""
    return f", found {_free_m2(grid):.1f} m² of free floor{missing}"


def _free_m2(grid: OccupancyGrid) -> float:
    """Return the area that is known to be free."""
    return int(((grid.cells >= FREE) & (grid.cells < MOST_FREE_PERCENT)).sum()) * grid.resolution_m**2


def _choose(
    search: "Search[Frontier | None]", before: DriveResult
) -> Generator[AnyLeg, DriveResult, "tuple[Frontier | None, DriveResult, str]"]:
    """Do some slices of the search in each cycle; return the frontier, the result so far and the problem."""
    sliced = SlicedSearch["Frontier | None"]()
    sliced.start(merged(search, SLICES_PER_CYCLE))
    found: Frontier | None = None

    def is_over() -> bool:
        nonlocal found
        found = sliced.advance()
        return not sliced.is_running

    try:
        waited = yield Wait(duration_s=math.inf, until=is_over, name="choosing a frontier")
    except ThumperError as refusal:
        return None, replace(before, reached=False, reason=str(refusal)), str(refusal)
    return found, waited.after(before), "" if waited.reached else waited.reason
