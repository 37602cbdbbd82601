"""Tasks of the robot's loop: one goal, waypoints, exploration, a drive at constant speed, a wait.

A task answers one question, "what next?". It yields a leg, the loop drives it, and the task receives the
result. If the loop refuses a leg before anything moves, `yield` raises ThumperError. The task returns the
result of the whole.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import TYPE_CHECKING

from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import AnyLeg, Cruise, Leg, Wait
from thumper.runtime.drive.waypoints import Waypoints
from thumper.runtime.drive_result import DriveResult

if TYPE_CHECKING:
    from thumper.common.resumable import Search
    from thumper.navigation.planners.frontier_exploration import Explorer


SLICES_PER_CYCLE = 3  # of the search for the next frontier: no planner runs meanwhile
Task = Generator[AnyLeg, DriveResult, DriveResult]


def drive_to_goal(goal: Goal, name: str = "driving", *, clear_fault: bool = False) -> Task:
    """Drive to one goal."""
    return (yield Leg(goal=goal, name=name, clear_fault=clear_fault))


def follow_waypoints(
    waypoints: Waypoints, *, clear_fault: bool = False, on_leg: Callable[[int], None] = lambda _number: None
) -> Task:
    """Drive to all waypoints in turn, until one is not reached; add up times and path lengths.

    `on_leg` receives the number of each leg, from 0, before it starts. The reason names the failed waypoint.
    Only the first may raise the ThumperError of a refusal; a later one that is refused ends the task like one
    that fails.
    """
    total: DriveResult | None = None
    for number, leg in enumerate(waypoints.legs()):
        on_leg(number)
        try:
            result = yield Leg(goal=leg.goal, name=leg.name, clear_fault=clear_fault)
        except ThumperError as refusal:
            if total is None:
                raise
            return replace(total, reached=False, reason=f"{leg.name} {leg.goal}: {refusal}")
        total = result.after(total)
        if not total.reached:
            if waypoints.has_one_leg:
                return total
            return replace(total, reason=f"{leg.name} {leg.goal}: {total.reason}")
    assert total is not None  # there is at least one waypoint
    return total


def explore(
    explorer: "Explorer",
    grid: Callable[[], OccupancyGrid],
    home: Goal,
    *,
    limit_s: float,
    report: Callable[[str], None],
) -> Task:
    """Drive from frontier to frontier until none is left or `limit_s` is over, then home.

    `report` receives a line for each frontier that is given up, and one at the end. The result's time and
    path length are those of all drives.
    """
    result, ending = yield from _drive_to_frontiers(explorer, grid, home, limit_s, report)
    report(ending)
    if result.interrupted:
        return result
    try:
        last = yield Leg(goal=home, name="home")
    except ThumperError as refusal:  # keep the map that there is
        return replace(result, reached=False, reason=str(refusal))
    return last.after(result)


def _drive_to_frontiers(
    explorer: "Explorer",
    grid: Callable[[], OccupancyGrid],
    home: Goal,
    limit_s: float,
    report: Callable[[str], None],
) -> Generator[AnyLeg, DriveResult, tuple[DriveResult, str]]:
    """Return the last result and why the exploration ended."""
    # The first drive ends where it starts: it makes the robot scan its surroundings for a first map.
    result = yield Leg(goal=home, name="initial scan")
    tried, reached = 0, 0
    while (spent_s := result.time_s) < limit_s and not result.interrupted:
        goal, result, problem = yield from _choose(explorer.search(grid(), result.map_from_base), result)
        if problem:
            return result, f"ended after {result.time_s:.0f} s: {problem}"
        if goal is None:
            explored = f"explored after {spent_s:.0f} s: reached {reached} of {tried} frontiers"
            return result, explored if tried else "nothing to explore here: no frontier is reachable"
        tried += 1
        try:
            drive = yield Leg(goal=goal, name=f"frontier {tried}")
        except ThumperError as refusal:  # a frontier is next to free space: the robot itself cannot drive
            ending = f"ended after {spent_s:.0f} s: {refusal}"
            return replace(result, reached=False, reason=str(refusal)), ending
        result = drive.after(result)
        reached += drive.reached
        if not drive.reached and not drive.interrupted:
            if not drive.navigation_failed:  # not the fault of the goal
                return result, f"ended after {result.time_s:.0f} s: {result.reason}"
            report(f"gave up frontier {tried} at {goal}: {result.reason}")
    why = "interrupted" if result.interrupted else "time is up"
    return result, f"{why} after {spent_s:.0f} s: reached {reached} of {tried} frontiers"


def _choose(
    search: "Search[Goal | None]", before: DriveResult
) -> Generator[AnyLeg, DriveResult, tuple[Goal | None, DriveResult, str]]:
    """Do some slices of the search in each cycle; return the goal, the result so far and what went wrong."""
    found: list[Goal | None] = []

    def is_over() -> bool:
        try:
            for _ in range(SLICES_PER_CYCLE):
                next(search)
        except StopIteration as end:
            found.append(end.value)
        return bool(found)

    try:
        waited = yield Wait(duration_s=math.inf, until=is_over, name="choosing a frontier")
    except ThumperError as refusal:
        return None, replace(before, reached=False, reason=str(refusal)), str(refusal)
    return found[0] if found else None, waited.after(before), "" if waited.reached else waited.reason


def cruise(twist: Twist2, duration_s: float) -> Task:
    """Drive at a constant speed for `duration_s`, without regard to obstacles."""
    return (yield Cruise(twist=twist, duration_s=duration_s))


def wait(duration_s: float = 0.0) -> Task:
    """Move nothing and map: until the newest data is in and a map is there, and then for `duration_s`."""
    return (yield Wait(duration_s=duration_s))


def wait_until(condition: Callable[[], bool], *, max_cycles: int) -> Task:
    """Move nothing until the condition is true, or `max_cycles` control cycles have passed."""
    return (yield Wait(duration_s=math.inf, until=condition, max_cycles=max_cycles))
