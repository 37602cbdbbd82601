"""Waypoints from the content of a request or a file. Pure."""

from collections.abc import Mapping
from typing import Any

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.gps.earth_reference import MapDatum
from thumper.maps.annotations import Annotations
from thumper.runtime.drive.waypoints import Waypoint, Waypoints
from thumper.runtime.requests import MAX_WAYPOINTS, parse_goal, parse_wait

MAX_LEGS = 2000  # of all rounds
TASKS = ("wait_s", "record", "beep")


def parse_waypoints(
    content: Mapping[str, Any], annotations: Annotations, datum: MapDatum | None = None
) -> Waypoints:
    """Return the goals of `content` as waypoints, and its rounds, by default one.

    A goal is what `parse_goal` takes, and optionally wait_s, record and beep.
    """
    goals, rounds = content.get("goals"), content.get("rounds", 1)
    if (
        not set(content) <= {"goals", "rounds"}
        or not isinstance(goals, list)
        or not 0 < len(goals) <= MAX_WAYPOINTS
    ):
        raise ThumperError(f"pass goals, a list of 1 to {MAX_WAYPOINTS}")
    if not all(isinstance(goal, dict) for goal in goals):
        raise ThumperError("each goal is an object with x_m and y_m")
    most = MAX_LEGS // len(goals)
    if not isinstance(rounds, int) or isinstance(rounds, bool) or not 1 <= rounds <= most:
        raise ThumperError(f"choose 1 to {most} rounds over {len(goals)} goals")
    points = tuple(_parse_waypoint(goal, annotations, datum) for goal in goals)
    return Waypoints(points=points, rounds=rounds)


def _parse_waypoint(content: dict[str, Any], annotations: Annotations, datum: MapDatum | None) -> Waypoint:
    place = {name: value for name, value in content.items() if name not in TASKS}
    wait_s, record = parse_wait(content.get("wait_s", 0.0)), content.get("record", False)
    if not isinstance(record, bool) or (record and not wait_s):
        raise ThumperError(
            "record is true or false; the robot records while it waits: choose a wait_s", exit_code=EXIT_USAGE
        )
    beep = content.get("beep", False)
    if not isinstance(beep, bool):
        raise ThumperError("beep is true or false", exit_code=EXIT_USAGE)
    return Waypoint(
        goal=parse_goal(place, annotations, datum),
        place=str(place.get("place", "")),
        wait_s=wait_s,
        record=record,
        beep=beep,
    )
