"""Checks what comes in, from whoever: topic, size, rate, form and range. What passes is a request. Pure."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.goal import Goal, check_place
from thumper.ros.codec import Message, decode
from thumper.ros.from_ros import pose_of, twist_of
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.requests import (
    COMMANDS,
    EmergencyStop,
    GoTo,
    Heartbeat,
    Query,
    Request,
    RobotCommand,
    SetPose,
    SimulatorCommand,
    TeleopSource,
    Velocity,
)

MOST_BYTES = 65_536
MOST_WAYPOINTS = 200
FASTEST_M_S, FASTEST_RAD_S = 5.0, 20.0
MOST_SOURCE_CHARACTERS = 64
RATES_HZ = {"heartbeat": 200.0, "teleop": 200.0, "gamepad": 200.0}
USUAL_RATE_HZ = 20.0

QUESTIONS = (
    "parameters/schema",
    "parameters/get",
    "parameters/set",
    "parameters/save",
    "parameters/revert",
    "mission/send",
    "mission/state",
    "mapping/state",
    "command",
    "simulator/world",
    "simulator/command",
    "experiment/start",
    "experiment/state",
    "experiment/report",
)


class RequestRefusedError(ValueError):
    """What came in is not let through; the message says why."""


class Gate:
    """Lets requests through, and no more of a kind than a robot can want."""

    def __init__(self) -> None:
        self._allowance: dict[str, tuple[float, float]] = {}  # topic -> messages left, at [s]

    def message(self, topic: str, raw: bytes, source: str, now_s: float) -> Request | None:
        """Return what a message on a topic asks for; None when it asks for nothing.

        Raises
        ------
        RefusedError
            Not a topic that takes messages, too long, too often, malformed, or out of range.
        """
        try:
            known = TOPICS.get(topic)
            if known is None or known.direction is not Direction.IN:
                raise RequestRefusedError("no such topic takes messages")
            self._check(topic, len(raw), source, now_s)
            return _READERS[topic](decode(raw, known.type_name), source)
        except ValueError as error:
            raise RequestRefusedError(f"{topic}: {error}") from error

    def question(
        self, name: str, raw: bytes, source: str, now_s: float, reply: Callable[[Mapping[str, Any]], None]
    ) -> Query:
        """Return what a query asks; its payload is a JSON object or nothing. Raises RefusedError."""
        try:
            if name not in QUESTIONS:
                raise RequestRefusedError(f"no such question; there are {', '.join(QUESTIONS)}")
            self._check(f"?{name}", len(raw), source, now_s)
            return Query(
                name=name, content=json_object(raw.decode()) if raw else {}, reply=reply, source=source
            )
        except ValueError as error:
            raise RequestRefusedError(f"{name}: {error}") from error

    def _check(self, name: str, size_bytes: int, source: str, now_s: float) -> None:
        if size_bytes > MOST_BYTES:
            raise RequestRefusedError(f"{size_bytes} bytes are too many")
        if len(source) > MOST_SOURCE_CHARACTERS or not source.isprintable():
            raise RequestRefusedError("the sender's name is too long or not printable")
        if name == "estop":
            return  # no flood may keep it out
        rate_Hz = RATES_HZ.get(name, USUAL_RATE_HZ)
        left, at_s = self._allowance.get(name, (rate_Hz, now_s))
        left = min(rate_Hz, left + (now_s - at_s) * rate_Hz)  # a second's worth may come at once
        passes = left >= 1.0  # what is refused costs nothing: who floods gets his share, and so do the others
        self._allowance[name] = (left - passes, now_s)
        if not passes:
            raise RequestRefusedError(f"more than {rate_Hz:g} messages a second")


def json_object(text: str) -> dict[str, Any]:
    """A JSON object whose numbers are finite; raises RefusedError."""

    def refuse(constant: str) -> float:
        raise RequestRefusedError(f"{constant} is no number")

    def finite(digits: str) -> float:
        value = float(digits)
        return value if math.isfinite(value) else refuse(digits)  # 1e999

    def whole(digits: str) -> int:
        finite(digits)  # nor may an integer be beyond what a float holds
        return int(digits)

    try:
        content = json.loads(text, parse_constant=refuse, parse_float=finite, parse_int=whole)
    except (ValueError, RecursionError) as error:
        raise RequestRefusedError(f"no JSON: {error}") from error
    if not isinstance(content, dict):
        raise RequestRefusedError("give a JSON object")
    return content


def _goal(pose: Message) -> Goal:
    place = pose_of(pose)
    _check_place(place)
    return Goal(x_m=place.x_m, y_m=place.y_m, theta_rad=place.theta_rad)


def _check_place(place: Pose2) -> None:
    try:
        check_place("the place", place.x_m, place.y_m)
    except ThumperError as error:
        raise RequestRefusedError(str(error)) from error


def _check_frame(frame: str) -> None:
    if frame not in ("map", ""):
        raise RequestRefusedError(f"frame {frame!r}: give it in the frame map")


def _read_goal(of: Message, source: str) -> Request:
    _check_frame(of.header.frame_id)
    return GoTo(goals=(_goal(of.pose),), source=source)


def _read_waypoints(of: Message, source: str) -> Request:
    _check_frame(of.header.frame_id)
    if not 0 < len(of.poses) <= MOST_WAYPOINTS:
        raise RequestRefusedError(f"{len(of.poses)} waypoints: give 1...{MOST_WAYPOINTS}")
    return GoTo(goals=tuple(_goal(stamped.pose) for stamped in of.poses), source=source)


def _read_initial_pose(of: Message, _source: str) -> Request:
    _check_frame(of.header.frame_id)
    place = pose_of(of.pose.pose)
    _check_place(place)
    return SetPose(map_from_base=place)


def _velocity(channel: TeleopSource) -> Callable[[Message, str], Request]:
    def read(of: Message, source: str) -> Request:
        twist: Twist2 = twist_of(of.twist)
        if abs(twist.v_m_s) > FASTEST_M_S or abs(twist.w_rad_s) > FASTEST_RAD_S:
            raise RequestRefusedError(
                f"{twist.v_m_s:g} m/s, {twist.w_rad_s:g} rad/s is no speed of this robot"
            )
        return Velocity(channel=channel, twist=twist, source=source)

    return read


def _read_command(of: Message, _source: str) -> Request:
    if of.data not in COMMANDS:
        raise RequestRefusedError(f"no such command; there are {', '.join(COMMANDS)}")
    return EmergencyStop() if of.data == "estop" else RobotCommand(name=of.data)


_READERS: Mapping[str, Callable[[Message, str], Request | None]] = {
    "goal": _read_goal,
    "waypoints": _read_waypoints,
    "initialpose": _read_initial_pose,
    "teleop": _velocity(TeleopSource.TELEOP),
    "gamepad": _velocity(TeleopSource.GAMEPAD),
    "heartbeat": lambda _of, source: Heartbeat(source=source),
    "estop": lambda of, _source: EmergencyStop() if of.data else None,  # let go of: nothing; it is latched
    "command": _read_command,
    "simulator/command": lambda of, _source: SimulatorCommand(content=json_object(of.data)),
}
