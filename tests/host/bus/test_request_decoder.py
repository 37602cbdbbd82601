"""Each incoming message becomes a request or is refused with a reason."""

import json
import math
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.bus.request_decoder import MAX_MESSAGE_BYTES, RequestDecoder, RequestRefusedError, json_object
from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.goal import Goal
from thumper.ros.codec import encode
from thumper.ros.to_ros import Messages, flag, text
from thumper.ros.topics import TOPICS
from thumper.runtime.requests import (
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

M = Messages()
HERE = Pose2(x_m=1.0, y_m=-2.0, theta_rad=0.5)


def request(
    topic: str, message: Any, source: str = "me", decoder: RequestDecoder | None = None
) -> Request | None:
    return (decoder or RequestDecoder()).decode_message(topic, encode(message), source, 0.0)


def goal_with_orientation_x(x: float) -> Any:
    goal = M.goal(0.0, HERE)
    goal.pose.orientation.x = x
    return goal


def test_a_goal() -> None:
    decoded = request("goal", M.goal(0.0, HERE))
    assert isinstance(decoded, GoTo)
    goal = decoded.goals[0]
    assert (goal.x_m, goal.y_m, goal.theta_rad) == pytest.approx((1.0, -2.0, 0.5))


def test_waypoints() -> None:
    decoded = request("waypoints", M.path(0.0, np.array([[0.0, 0.0], [1.0, 0.0]])))
    assert isinstance(decoded, GoTo)
    assert [str(goal) for goal in decoded.goals] == ["(0.00, 0.00)", "(1.00, 0.00)"]


@pytest.mark.parametrize(
    ("topic", "message", "expected"),
    [
        ("initialpose", M.pose(0.0, Pose2(x_m=1.0)), SetPose(map_from_base=Pose2(x_m=1.0))),
        (
            "teleop",
            M.twist(0.0, Twist2(v_m_s=0.2)),
            Velocity(channel=TeleopSource.TELEOP, twist=Twist2(v_m_s=0.2), source="me"),
        ),
        (
            "gamepad",
            M.twist(0.0, Twist2(w_rad_s=1.0)),
            Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=1.0), source="me"),
        ),
        ("heartbeat", M.header(0.0), Heartbeat(source="me")),
        ("override", flag(True), OverrideAssistance()),
        ("override", flag(False), None),
        ("estop", flag(True), EmergencyStop()),
        ("estop", flag(False), None),
        ("command", text("cancel"), RobotCommand(name="cancel")),
        ("command", text("estop"), EmergencyStop()),
        ("simulator/command", text('{"speed": 2}'), SimulatorCommand(content={"speed": 2})),
    ],
)
def test_valid_messages_become_requests(topic: str, message: Any, expected: Request | None) -> None:
    assert request(topic, message) == expected


@pytest.mark.parametrize(
    ("topic", "message", "reason"),
    [
        ("scan", text("hello"), "this topic takes no messages"),
        ("nonsense", text("hello"), "this topic takes no messages"),
        ("command", text("rm -rf /"), "no such command"),
        ("command", text("../../save_map"), "no such command"),
        ("goal", M.goal(0.0, Pose2(x_m=math.nan)), "not finite"),
        ("goal", M.goal(0.0, Pose2(x_m=1e9)), "farther"),
        ("goal", goal_with_orientation_x(1e200), "the orientation has length"),
        ("goal", text("not a pose"), "not a valid geometry_msgs"),
        ("waypoints", M.path(0.0, np.zeros((0, 2))), "0 waypoints"),
        ("waypoints", M.path(0.0, np.zeros((201, 2))), "201 waypoints"),
        ("teleop", M.twist(0.0, Twist2(v_m_s=math.inf)), "not finite"),
        ("gamepad", M.twist(0.0, Twist2(v_m_s=6.0)), "too fast"),
        ("simulator/command", text("[1]"), "JSON object"),
        ("simulator/command", text('{"speed": NaN}'), "not a finite number"),
        ("simulator/command", text("[" * 10_000), "not valid JSON"),
        ("command", text("x" * (MAX_MESSAGE_BYTES + 1)), "the limit is 65536"),
    ],
)
def test_invalid_messages_are_refused(topic: str, message: Any, reason: str) -> None:
    decoder = RequestDecoder()
    with pytest.raises(RequestRefusedError, match=reason):
        request(topic, message, decoder=decoder)


def test_a_goal_in_another_frame_is_refused() -> None:
    message = M.goal(0.0, HERE)
    message.header.frame_id = "odom"
    with pytest.raises(RequestRefusedError, match="use the frame map"):
        request("goal", message)


@pytest.mark.parametrize("source", ["x" * 65, "a\nb", "\x1b[2J"])
def test_invalid_source_is_refused(source: str) -> None:
    with pytest.raises(RequestRefusedError, match="name of the source"):
        request("heartbeat", M.header(0.0), source)


def test_rate_limit_per_topic_except_estop() -> None:
    decoder, raw = RequestDecoder(), encode(text("arm"))
    for _ in range(20):
        decoder.decode_message("command", raw, "", 0.0)
    with pytest.raises(RequestRefusedError, match="20 messages per second"):
        decoder.decode_message("command", raw, "", 0.0)
    assert decoder.decode_message("command", raw, "", 0.1) == RobotCommand(name="arm")
    for _ in range(1000):
        assert decoder.decode_message("estop", encode(flag(False)), "", 0.0) is None
    # An emergency stop is never limited.
    assert decoder.decode_message("estop", encode(flag(True)), "", 0.0) == EmergencyStop()
    assert decoder.decode_message("heartbeat", encode(M.header(0.0)), "", 0.0)  # the limit is per topic


def test_flood_still_gets_its_rate() -> None:
    """100 messages per second for 10 s: a burst of 20 passes, then 20 per second."""
    decoder, raw, passed = RequestDecoder(), encode(text("arm")), 0
    for count in range(1000):
        with suppress(RequestRefusedError):
            decoder.decode_message("command", raw, "", count / 100)
            passed += 1
    assert passed == pytest.approx(220, abs=1)


@pytest.mark.parametrize("text_", [5000 * "x", "a\nb\x1b[2J"])
def test_what_a_refusal_repeats_is_short_and_printable(text_: str) -> None:
    with pytest.raises(RequestRefusedError) as topic_refused:
        RequestDecoder().decode_message(text_, b"", "", 0.0)
    raw = json.dumps({text_: 1}).encode()
    with pytest.raises(RequestRefusedError) as query_refused:
        RequestDecoder().decode_query("mission/send", raw, "", 0.0, lambda _: None)
    for refused in (topic_refused, query_refused):
        assert len(str(refused.value)) <= 300
        assert str(refused.value).isprintable()


@given(raw=st.binary(max_size=300), topic=st.sampled_from(sorted(TOPICS)))
def test_any_bytes_give_a_request_or_a_refusal(raw: bytes, topic: str) -> None:
    try:
        decoded = RequestDecoder().decode_message(topic, raw, "", 0.0)
    except RequestRefusedError:
        return
    if isinstance(decoded, GoTo):
        assert all(isinstance(goal, Goal) and math.isfinite(goal.x_m + goal.y_m) for goal in decoded.goals)
    elif isinstance(decoded, Velocity):
        assert abs(decoded.twist.v_m_s) <= 5.0


@pytest.mark.parametrize(
    ("topic", "message", "most"),
    [
        ("goal", M.goal(0.0, HERE), 20),
        ("teleop", M.twist(0.0, Twist2(v_m_s=0.2)), 200),
        ("gamepad", M.twist(0.0, Twist2(v_m_s=0.2)), 200),
        ("velocity", M.twist(0.0, Twist2(v_m_s=0.2)), 200),
        ("heartbeat", M.header(0.0), 200),
    ],
)
def test_each_topic_has_its_rate(topic: str, message: Any, most: int) -> None:
    decoder, raw = RequestDecoder(), encode(message)
    for _ in range(most):
        decoder.decode_message(topic, raw, "", 0.0)
    with pytest.raises(RequestRefusedError, match=f"{most} messages per second"):
        decoder.decode_message(topic, raw, "", 0.0)


def test_longest_source_and_message() -> None:
    assert request("heartbeat", M.header(0.0), "x" * 64) == Heartbeat(source="x" * 64)
    with pytest.raises(RequestRefusedError, match="no such command"):  # not its length: 65536 bytes
        RequestDecoder().decode_message("command", _command_of(MAX_MESSAGE_BYTES), "", 0.0)
    with pytest.raises(RequestRefusedError, match="the limit is 65536"):
        RequestDecoder().decode_message("command", _command_of(MAX_MESSAGE_BYTES + 1), "", 0.0)


def _command_of(size: int) -> bytes:
    return encode(text("x" * (size - len(encode(text(""))))))


@pytest.mark.parametrize("twist", [Twist2(v_m_s=5.0), Twist2(v_m_s=-5.0), Twist2(w_rad_s=20.0)])
def test_fastest_manual_command(twist: Twist2) -> None:
    assert request("gamepad", M.twist(0.0, twist)) is not None


def test_one_waypoint_and_an_empty_query() -> None:
    assert isinstance(request("waypoints", M.path(0.0, np.zeros((1, 2)))), GoTo)
    query = RequestDecoder().decode_query("parameters/get", b"", "", 0.0, lambda _: None)
    assert isinstance(query, Query)
    assert query.content == {}


def test_faster_turn_than_any_robot_makes_is_refused() -> None:
    with pytest.raises(RequestRefusedError, match="too fast"):
        request("gamepad", M.twist(0.0, Twist2(w_rad_s=20.5)))


def test_query_with_content() -> None:
    decoded = RequestDecoder().decode_query("parameters/set", b'{"kp": 1.5}', "me", 0.0, lambda _: None)
    assert isinstance(decoded, Query)
    assert (decoded.name, decoded.content, decoded.source) == ("parameters/set", {"kp": 1.5}, "me")


@pytest.mark.parametrize(
    ("name", "raw", "reason"),
    [
        ("shutdown", b"", "no such service"),
        ("parameters/set", b"kp=1", "not valid JSON"),
        ("parameters/set", b"\xff\xfe", "parameters/set"),
        ("parameters/set", b"[]", "JSON object"),
    ],
)
def test_invalid_queries_are_refused(name: str, raw: bytes, reason: str) -> None:
    with pytest.raises(RequestRefusedError, match=reason):
        RequestDecoder().decode_query(name, raw, "", 0.0, lambda _: None)


def test_non_finite_numbers_are_refused() -> None:
    assert json_object('{"a": [1, {"b": null}]}') == {"a": [1, {"b": None}]}
    with pytest.raises(RequestRefusedError, match="Infinity"):
        json_object('{"a": Infinity}')
    with pytest.raises(RequestRefusedError, match="1e999"):
        json_object('{"a": 1e999}')
    with pytest.raises(RequestRefusedError, match="is not a finite number"):
        json_object('{"a": 1%s}' % ("0" * 400))
