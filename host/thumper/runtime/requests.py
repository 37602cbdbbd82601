"""Requests to a running robot, already checked. Plain data, independent of the transport."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.gps.earth_reference import DRIVE_TO_FIND_IT, MapDatum
from thumper.gps.local_plane import EXCHANGED, LatLon
from thumper.maps.annotations import Annotations
from thumper.navigation.goal import FARTHEST_M, Goal, check_place

MAX_WAYPOINTS = 200
GOAL_TOLERANCE_M = (0.02, 1.0)
MAX_WAIT_S = 3600.0  # at a waypoint
EARTH = ("latitude_deg", "longitude_deg")
NO_DATUM = f"the map has no place on Earth: it needs a datum in its YAML, or [gps] and {DRIVE_TO_FIND_IT}"


def parse_goal(
    content: Mapping[str, Any], annotations: Annotations | None = None, datum: MapDatum | None = None
) -> Goal:
    """Return the goal in `content`: x_m, y_m and optionally yaw_rad and tolerance_m, all of them numbers.

    Instead of x_m, y_m and yaw_rad it may have the name of a place of `annotations`. Instead of x_m and y_m
    it may have latitude_deg and longitude_deg if the map has a `datum`.
    """
    if "latitude_deg" in content or "longitude_deg" in content:
        content = _in_map(content, datum)
    if "place" in content:
        content = dict(content)
        place = (annotations or Annotations()).place(str(content.pop("place")))
        if set(content) - {"tolerance_m"}:
            raise ThumperError("a goal at a place has place and optionally tolerance_m")
        content |= {"x_m": place.x_m, "y_m": place.y_m}
        if place.yaw_rad is not None:
            content["yaw_rad"] = place.yaw_rad
    known = {"x_m", "y_m", "yaw_rad", "tolerance_m"}
    numbers = {
        name: float(value)
        for name, value in content.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    }
    if set(numbers) != set(content) or not {"x_m", "y_m"} <= set(numbers) <= known:
        raise ThumperError("a goal has x_m, y_m and optionally yaw_rad and tolerance_m, all finite numbers")
    tolerance_m = numbers.get("tolerance_m", 0.1)
    if not GOAL_TOLERANCE_M[0] <= tolerance_m <= GOAL_TOLERANCE_M[1]:
        raise ThumperError("choose a goal tolerance of 0.02...1 m")
    check_place("the goal", numbers["x_m"], numbers["y_m"])
    return Goal(
        x_m=numbers["x_m"],
        y_m=numbers["y_m"],
        theta_rad=numbers.get("yaw_rad"),
        tolerance_m=tolerance_m,
    )


def _in_map(content: Mapping[str, Any], datum: MapDatum | None) -> dict[str, Any]:
    """Return a goal on Earth with x_m and y_m; raise ThumperError if the map has no place on Earth."""
    numbers = [content.get(name) for name in EARTH]
    are_numbers = all(isinstance(value, int | float) for value in numbers)
    if {"x_m", "y_m", "place"} & set(content) or not are_numbers:
        raise ThumperError("a goal on Earth has latitude_deg and longitude_deg, both numbers, as its place")
    place = LatLon(*(float(value or 0.0) for value in numbers))
    place.check()
    if datum is None:
        raise ThumperError(NO_DATUM)
    x_m, y_m = place_in_map(place, datum)
    return {name: value for name, value in content.items() if name not in EARTH} | {"x_m": x_m, "y_m": y_m}


def place_in_map(place: LatLon, datum: MapDatum) -> tuple[float, float]:
    """Return x and y of a place on Earth [m]; raise ThumperError if it is too far from the map."""
    origin = LatLon(datum.latitude_deg, datum.longitude_deg)
    distance_m = origin.distance_m(place)
    if distance_m > FARTHEST_M:
        hint = EXCHANGED if origin.distance_m(place.exchanged) <= FARTHEST_M else ""
        raise ThumperError(
            f"the place {place} is {distance_m / 1000.0:.1f} km from the map's origin; the farthest goal is "
            f"{FARTHEST_M / 1000.0:g} km away{hint}",
            exit_code=EXIT_USAGE,
        )
    return datum.to_map(place)


def parse_wait(wait_s: object) -> float:
    """Return the time that the robot waits at a waypoint [s]; raise ThumperError if it is impossible."""
    if not isinstance(wait_s, int | float) or isinstance(wait_s, bool) or not 0.0 <= wait_s <= MAX_WAIT_S:
        raise ThumperError(f"choose a wait_s of 0...{MAX_WAIT_S:g} s at a waypoint", exit_code=EXIT_USAGE)
    return float(wait_s)


# The topic `command` accepts these words and no others.
COMMANDS = (
    *("cancel", "clear_fault", "clear_costmaps", "arm", "disarm", "estop"),
    *(
        "record_start",
        "record_stop",
        "save_map",
        "explore",
        "dock",
        "undock",
        "localize",
        "map_on",
        "relocalize",
    ),
)


class TeleopSource(IntEnum):
    """Source of manual commands; the greater one has priority."""

    VELOCITY = 0  # another program
    TELEOP = 1
    GAMEPAD = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class GoTo:
    """Drive to these goals, one after another."""

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Velocity:
    """A manual command; it expires soon."""

    channel: TeleopSource
    twist: Twist2
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OverrideAssistance:
    """Manual commands may touch obstacles; it expires soon."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat:
    """The client is alive: the experiment that it started may go on."""

    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EmergencyStop:
    """Switch the motors off and latch the fault."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotCommand:
    """One of `COMMANDS`."""

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPose:
    """Set the robot's pose in the map."""

    map_from_base: Pose2


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorCommand:
    """Change the simulation; a real robot refuses it."""

    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMessage:
    """A line for people, from another thread of this process."""

    text: str
    good: bool = False  # success; else a warning


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """A request with an answer. The loop calls `reply` once; it must not block."""

    name: str
    content: Mapping[str, Any]
    reply: Callable[[Mapping[str, Any]], None]
    source: str = ""


Request = (
    GoTo
    | Velocity
    | OverrideAssistance
    | Heartbeat
    | EmergencyStop
    | RobotCommand
    | SetPose
    | SimulatorCommand
    | LogMessage
    | Query
)
