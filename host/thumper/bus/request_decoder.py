"""Check what clients send (topic, size, rate, form, range) and turn it into requests. No input or output."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.common.texts import shortened
from thumper.navigation.goal import Goal, check_place
from thumper.ros.codec import Message, decode
from thumper.ros.from_ros import pose_of, twist_of
from thumper.ros.services import SERVICES
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.requests import (
    COMMANDS,
    MAX_WAYPOINTS,
    EmergencyStop,
    GoTo,
    Heartbeat,
    OverrideAssistance,
    Query,
    Request,
    RobotCommand,
    SetPose,
    SimulatorCommand,
    TeleopSource,
    Velocity,
)

MAX_MESSAGE_BYTES = 65_536
MAX_V_M_S, MAX_W_RAD_S = 5.0, 20.0
MAX_SOURCE_CHARACTERS = 64
RATES_HZ = {"heartbeat": 200.0, "velocity": 200.0, "teleop": 200.0, "gamepad": 200.0, "override": 200.0}
DEFAULT_RATE_HZ = 20.0


class RequestRefusedError(ValueError):
    """A message or query is refused; the text gives the reason."""


class RequestDecoder:
    """Decodes and checks messages and queries, and limits the rate of each kind."""

    def __init__(self) -> None:
        self._tokens: dict[str, tuple[float, float]] = {}  # name -> messages left, at time [s]

    def decode_message(self, topic: str, raw: bytes, source: str, now_s: float) -> Request | None:
        """Return the request of a message; None if it requests nothing.

        Raises
        ------
        RequestRefusedError
            The topic takes no messages, or the message is too long, too frequent, malformed or out of range.
        """
        try:
            known = TOPICS.get(topic)
            if known is None or known.direction is not Direction.IN:
                raise RequestRefusedError("this topic takes no messages")
            self._check(topic, len(raw), source, now_s)
            return _READERS[topic](decode(raw, known.type_name), source)
        except ValueError as error:
            raise RequestRefusedError(shortened(f"{topic}: {error}")) from error

    def decode_query(
        self, name: str, raw: bytes, source: str, now_s: float, reply: Callable[[Mapping[str, Any]], None]
    ) -> Query:
        """Return the query; its payload is a JSON object or empty. Raises RequestRefusedError."""
        try:
            service = SERVICES.get(name)
            if service is None:
                raise RequestRefusedError(f"no such service; choose from: {', '.join(SERVICES)}")
            self._check(f"?{name}", len(raw), source, now_s)
            content = json_object(raw.decode()) if raw else {}
            service.check(content)
            return Query(name=name, content=content, reply=reply, source=source)
        except ValueError as error:
            raise RequestRefusedError(shortened(f"{name}: {error}")) from error

    def _check(self, name: str, size_bytes: int, source: str, now_s: float) -> None:
        if size_bytes > MAX_MESSAGE_BYTES:
            raise RequestRefusedError(f"{size_bytes} bytes; the limit is {MAX_MESSAGE_BYTES}")
        if len(source) > MAX_SOURCE_CHARACTERS or not source.isprintable():
            raise RequestRefusedError("the name of the source is too long or not printable")
        if name == "estop":
            return  # an emergency stop is never rate-limited
        rate_Hz = RATES_HZ.get(name, DEFAULT_RATE_HZ)
        left, at_s = self._tokens.get(name, (rate_Hz, now_s))
        left = min(rate_Hz, left + (now_s - at_s) * rate_Hz)  # a burst of one second is allowed
        passes = left >= 1.0  # refused ones cost no token: a flood does not lock out others
        self._tokens[name] = (left - passes, now_s)
        if not passes:
            raise RequestRefusedError(f"more than {rate_Hz:g} messages per second")


def json_object(text: str) -> dict[str, Any]:
    """Parse a JSON object whose numbers are finite; raises RequestRefusedError."""

    def refuse(constant: str) -> float:
        raise RequestRefusedError(f"{constant} is not a finite number")

    def finite(digits: str) -> float:
        value = float(digits)
        return value if math.isfinite(value) else refuse(digits)  # 1e999

    def whole(digits: str) -> int:
        finite(digits)  # an integer must not exceed the range of a float either
        return int(digits)

    try:
        content = json.loads(text, parse_constant=refuse, parse_float=finite, parse_int=whole)
    except (ValueError, RecursionError) as error:
        raise RequestRefusedError(f"not valid JSON: {error}") from error
    if not isinstance(content, dict):
        raise RequestRefusedError("expected a JSON object")
    return content


def _goal(pose_msg: Message) -> Goal:
    pose = pose_of(pose_msg)
    _check_position(pose)
    return Goal(x_m=pose.x_m, y_m=pose.y_m, theta_rad=pose.theta_rad)


def _check_position(pose: Pose2) -> None:
    try:
        check_place("the position", pose.x_m, pose.y_m)
    except ThumperError as error:
        raise RequestRefusedError(str(error)) from error


def _check_frame(frame: str) -> None:
    if frame not in ("map", ""):
        raise RequestRefusedError(f"frame {frame!r} is not supported; use the frame map")


def _read_goal(msg: Message, _source: str) -> Request:
    _check_frame(msg.header.frame_id)
    return GoTo(goals=(_goal(msg.pose),))


def _read_waypoints(msg: Message, _source: str) -> Request:
    _check_frame(msg.header.frame_id)
    if not 0 < len(msg.poses) <= MAX_WAYPOINTS:
        raise RequestRefusedError(f"{len(msg.poses)} waypoints; send 1 to {MAX_WAYPOINTS}")
    return GoTo(goals=tuple(_goal(stamped.pose) for stamped in msg.poses))


def _read_initial_pose(msg: Message, _source: str) -> Request:
    _check_frame(msg.header.frame_id)
    pose = pose_of(msg.pose.pose)
    _check_position(pose)
    return SetPose(map_from_base=pose)


def _velocity(channel: TeleopSource) -> Callable[[Message, str], Request]:
    def read(msg: Message, source: str) -> Request:
        twist: Twist2 = twist_of(msg.twist)
        if abs(twist.v_m_s) > MAX_V_M_S or abs(twist.w_rad_s) > MAX_W_RAD_S:
            raise RequestRefusedError(
                f"{twist.v_m_s:g} m/s, {twist.w_rad_s:g} rad/s is too fast; "
                f"the limits are {MAX_V_M_S:g} m/s and {MAX_W_RAD_S:g} rad/s"
            )
        return Velocity(channel=channel, twist=twist, source=source)

    return read


def _read_command(msg: Message, _source: str) -> Request:
    if msg.data not in COMMANDS:
        raise RequestRefusedError(f"no such command; choose from: {', '.join(COMMANDS)}")
    return EmergencyStop() if msg.data == "estop" else RobotCommand(name=msg.data)


_READERS: Mapping[str, Callable[[Message, str], Request | None]] = {
    "goal": _read_goal,
    "waypoints": _read_waypoints,
    "initialpose": _read_initial_pose,
    "velocity": _velocity(TeleopSource.VELOCITY),
    "teleop": _velocity(TeleopSource.TELEOP),
    "gamepad": _velocity(TeleopSource.GAMEPAD),
    "override": lambda msg, _source: OverrideAssistance() if msg.data else None,
    "heartbeat": lambda _msg, source: Heartbeat(source=source),
    "estop": lambda msg, _source: (
        EmergencyStop() if msg.data else None
    ),  # False is ignored: the E-stop is latched
    "command": _read_command,
    "simulator/command": lambda msg, _source: SimulatorCommand(content=json_object(msg.data)),
}
