"""Tasks of the robot's loop: one goal, waypoints, a drive at constant speed, a wait.

A task answers one question, "what next?". It yields a leg, the loop drives it, and the task receives the
result. If the loop refuses a leg before anything moves, `yield` raises ThumperError. The task returns the
result of the whole.
"""

import math
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import AnyLeg, Cruise, Leg, Move, Wait
from thumper.runtime.drive.motions import Motion
from thumper.runtime.drive.waypoints import Waypoints
from thumper.runtime.drive_result import DriveResult

Task = Generator[AnyLeg, DriveResult, DriveResult]


def drive_to_goal(goal: Goal, name: str = "driving", *, clear_fault: bool = False) -> Task:
    """Drive to one goal."""
    return (yield Leg(goal=goal, name=name, clear_fault=clear_fault))


def follow_waypoints(
    waypoints: Waypoints,
    *,
    clear_fault: bool = False,
    on_leg: Callable[[int], None] = lambda _number: None,
    on_beep: Callable[[str], None] = lambda _name: None,
    recording: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> Task:
    """Drive to all waypoints in turn, until one is not reached; wait at each, motors off, for its time.

    Where a waypoint asks for it, the robot is `recording` while it waits.

    Times and path lengths are added up.

    `on_leg` receives the number of each leg, from 0, before it starts. `on_beep` receives the name of a
    waypoint on arrival, if it asks for a beep. The reason names the failed waypoint.
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
        if total.reached and leg.beep:
            on_beep(leg.name)
        if total.reached and leg.wait_s:
            try:
                with recording() if leg.record else nullcontext():
                    waited = yield Wait(duration_s=leg.wait_s, name=f"waiting, {leg.name}")
                total = replace(waited.after(total), reason=total.reason if waited.reached else waited.reason)
            except ThumperError as refusal:
                total = replace(total, reached=False, reason=str(refusal))
        if not total.reached:
            if waypoints.has_one_leg:
                return total
            return replace(total, reason=f"{leg.name} {leg.goal}: {total.reason}")
    assert total is not None  # there is at least one waypoint
    return total


def cruise(twist: Twist2, duration_s: float) -> Task:
    """Drive at a constant speed for `duration_s`, without regard to obstacles."""
    return (yield Cruise(twist=twist, duration_s=duration_s))


def move(motion: Motion) -> Task:
    """Carry out one simple motion."""
    return (yield Move(motion=motion))


def wait(duration_s: float = 0.0) -> Task:
    """Move nothing and map: until the newest data is in and a map is there, and then for `duration_s`."""
    return (yield Wait(duration_s=duration_s))


def wait_until(condition: Callable[[], bool], *, max_cycles: int) -> Task:
    """Move nothing until the condition is true, or `max_cycles` control cycles have passed."""
    return (yield Wait(duration_s=math.inf, until=condition, max_cycles=max_cycles))
