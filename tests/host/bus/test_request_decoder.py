"""Whatever comes in is a request or is refused with a reason; nothing in between."""

import math
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.bus.request_decoder import MOST_BYTES, Gate, RequestRefusedError, json_object
from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.goal import Goal
from thumper.ros.codec import encode
from thumper.ros.to_ros import Messages, flag, text
from thumper.ros.topics import TOPICS
from thumper.runtime.requests import (
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

M = Messages()
HERE = Pose2(x_m=1.0, y_m=-2.0, theta_rad=0.5)


def request(topic: str, message: Any, source: str = "me", gate: Gate | None = None) -> Request | None:
    return (gate or Gate()).message(topic, encode(message), source, 0.0)


def turned_by(x: float) -> Any:
    goal = M.goal(0.0, HERE)
    goal.pose.orientation.x = x
    return goal


def test_a_goal() -> None:
    asked = request("goal", M.goal(0.0, HERE))
    assert isinstance(asked, GoTo)
    assert asked.source == "me"
    goal = asked.goals[0]
    assert (goal.x_m, goal.y_m, goal.theta_rad) == pytest.approx((1.0, -2.0, 0.5))


def test_waypoints() -> None:
    asked = request("waypoints", M.path(0.0, np.array([[0.0, 0.0], [1.0, 0.0]])))
    assert isinstance(asked, GoTo)
    assert [str(goal) for goal in asked.goals] == ["(0.00, 0.00)", "(1.00, 0.00)"]


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
        ("estop", flag(True), EmergencyStop()),
        ("estop", flag(False), None),
        ("command", text("cancel"), RobotCommand(name="cancel")),
        ("command", text("estop"), EmergencyStop()),
        ("simulator/command", text('{"speed": 2}'), SimulatorCommand(content={"speed": 2})),
    ],
)
def test_what_passes(topic: str, message: Any, expected: Request | None) -> None:
    assert request(topic, message) == expected


@pytest.mark.parametrize(
    ("topic", "message", "why"),
    [
        ("scan", text("hello"), "no such topic takes"),
        ("nonsense", text("hello"), "no such topic takes"),
        ("command", text("rm -rf /"), "no such command"),
        ("command", text("../../save_map"), "no such command"),
        ("goal", M.goal(0.0, Pose2(x_m=math.nan)), "not finite"),
        ("goal", M.goal(0.0, Pose2(x_m=1e9)), "farther"),
        ("goal", turned_by(1e200), "an orientation of length"),
        ("goal", text("not a pose"), "no geometry_msgs"),
        ("waypoints", M.path(0.0, np.zeros((0, 2))), "0 waypoints"),
        ("waypoints", M.path(0.0, np.zeros((201, 2))), "201 waypoints"),
        ("teleop", M.twist(0.0, Twist2(v_m_s=math.inf)), "not finite"),
        ("gamepad", M.twist(0.0, Twist2(v_m_s=6.0)), "no speed"),
        ("simulator/command", text("[1]"), "JSON object"),
        ("simulator/command", text('{"speed": NaN}'), "no number"),
        ("simulator/command", text("[" * 10_000), "no JSON"),
        ("command", text("x" * (MOST_BYTES + 1)), "too many"),
    ],
)
def test_what_is_refused(topic: str, message: Any, why: str) -> None:
    gate = Gate()
    with pytest.raises(RequestRefusedError, match=why):
        request(topic, message, gate=gate)


def test_a_goal_in_another_frame_is_refused() -> None:
    message = M.goal(0.0, HERE)
    message.header.frame_id = "odom"
    with pytest.raises(RequestRefusedError, match="in the frame map"):
        request("goal", message)


@pytest.mark.parametrize("source", ["x" * 65, "a\nb", "\x1b[2J"])
def test_a_sender_whose_name_is_no_name_is_refused(source: str) -> None:
    with pytest.raises(RequestRefusedError, match="sender's name"):
        request("heartbeat", M.header(0.0), source)


def test_too_often_is_refused_and_waiting_helps() -> None:
    gate, raw = Gate(), encode(text("arm"))
    for _ in range(20):
        gate.message("command", raw, "", 0.0)
    with pytest.raises(RequestRefusedError, match="20 messages a second"):
        gate.message("command", raw, "", 0.0)
    assert gate.message("command", raw, "", 0.1) == RobotCommand(name="arm")
    for _ in range(1000):
        assert gate.message("estop", encode(flag(False)), "", 0.0) is None
    assert gate.message("estop", encode(flag(True)), "", 0.0) == EmergencyStop()  # no flood keeps it out
    assert gate.message("heartbeat", encode(M.header(0.0)), "", 0.0)  # each topic for itself


def test_a_flood_lets_its_share_through() -> None:
    """Asked a hundred times a second, for ten: the twenty at once, and then twenty a second."""
    gate, raw, passed = Gate(), encode(text("arm")), 0
    for count in range(1000):
        with suppress(RequestRefusedError):
            gate.message("command", raw, "", count / 100)
            passed += 1
    assert passed == pytest.approx(220, abs=1)


@given(raw=st.binary(max_size=300), topic=st.sampled_from(sorted(TOPICS)))
def test_any_bytes_are_a_request_or_a_refusal(raw: bytes, topic: str) -> None:
    try:
        asked = Gate().message(topic, raw, "", 0.0)
    except RequestRefusedError:
        return
    if isinstance(asked, GoTo):
        assert all(isinstance(goal, Goal) and math.isfinite(goal.x_m + goal.y_m) for goal in asked.goals)
    elif isinstance(asked, Velocity):
        assert abs(asked.twist.v_m_s) <= 5.0


def test_a_question_with_its_content() -> None:
    asked = Gate().question("parameters/set", b'{"kp": 1.5}', "me", 0.0, lambda _: None)
    assert isinstance(asked, Query)
    assert (asked.name, asked.content, asked.source) == ("parameters/set", {"kp": 1.5}, "me")


@pytest.mark.parametrize(
    ("name", "raw", "why"),
    [
        ("shutdown", b"", "no such question"),
        ("parameters/set", b"kp=1", "no JSON"),
        ("parameters/set", b"\xff\xfe", "parameters/set"),
        ("parameters/set", b"[]", "JSON object"),
    ],
)
def test_a_question_that_is_none(name: str, raw: bytes, why: str) -> None:
    with pytest.raises(RequestRefusedError, match=why):
        Gate().question(name, raw, "", 0.0, lambda _: None)


def test_numbers_that_are_none_are_refused() -> None:
    assert json_object('{"a": [1, {"b": null}]}') == {"a": [1, {"b": None}]}
    with pytest.raises(RequestRefusedError, match="Infinity"):
        json_object('{"a": Infinity}')
    with pytest.raises(RequestRefusedError, match="1e999"):
        json_object('{"a": 1e999}')
    with pytest.raises(RequestRefusedError, match="is no number"):
        json_object('{"a": 1%s}' % ("0" * 400))
