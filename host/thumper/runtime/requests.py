"""What may be asked of a running robot, after it was checked. Plain data, from whatever border it came."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.goal import Goal, check_place


def parse_goal(content: Mapping[str, Any]) -> Goal:
    """x_m, y_m, and perhaps yaw_rad and tolerance_m; nothing else, and all of them numbers."""
    known = {"x_m", "y_m", "yaw_rad", "tolerance_m"}
    numbers = {
        name: float(value)
        for name, value in content.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    }
    if set(numbers) != set(content) or not {"x_m", "y_m"} <= set(numbers) <= known:
        raise ThumperError("a goal is x_m, y_m and perhaps yaw_rad and tolerance_m, all of them numbers")
    tolerance_m = numbers.get("tolerance_m", 0.1)
    if not 0.02 <= tolerance_m <= 1.0:
        raise ThumperError("a goal's tolerance is 0.02...1 m")
    check_place("the goal", numbers["x_m"], numbers["y_m"])
    return Goal(
        x_m=numbers["x_m"],
        y_m=numbers["y_m"],
        theta_rad=numbers.get("yaw_rad"),
        tolerance_m=tolerance_m,
    )


# Words that the topic `command` takes; nothing else is ever carried out.
COMMANDS = (
    *("cancel", "clear_fault", "arm", "disarm", "estop"),
    *("record_start", "record_stop", "save_map", "localise", "map_on", "relocalise"),
)


class TeleopSource(IntEnum):
    """Who drives by hand; the greater one goes first."""

    TELEOP = 1
    GAMEPAD = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class GoTo:
    """Drive to these places, one after another."""

    goals: tuple[Goal, ...]
    source: str = ""  # who asks: a heartbeat under the same name must not fail


@dataclass(frozen=True, slots=True, kw_only=True)
class Velocity:
    """Drive like this, by hand, for a moment."""

    channel: TeleopSource
    twist: Twist2
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat:
    """The page is alive."""

    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EmergencyStop:
    """Motors off, latched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotCommand:
    """One of `COMMANDS`."""

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPose:
    """The robot stands here."""

    map_from_base: Pose2


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorCommand:
    """Change the simulated world; refused on a real robot."""

    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMessage:
    """A line for people, from another thread."""

    text: str
    good: bool = False  # a mere word that something is done


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """A question that wants an answer: `reply` is called once, from the robot's loop, and must not block."""

    name: str
    content: Mapping[str, Any]
    reply: Callable[[Mapping[str, Any]], None]
    source: str = ""


Request = (
    GoTo
    | Velocity
    | Heartbeat
    | EmergencyStop
    | RobotCommand
    | SetPose
    | SimulatorCommand
    | LogMessage
    | Query
)
