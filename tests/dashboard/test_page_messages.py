"""Messages that a page may send; all others are refused. No browser."""

import json
import math
import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.geometry import Pose2
from thumper.dashboard import page_messages
from thumper.dashboard.binary_packet import encode_packet, grid_png
from thumper.dashboard.page_messages import (
    EStop,
    GoalMessage,
    PageHeartbeat,
    PageMessage,
    PageMessageError,
    Teleop,
    parse_message,
)
from thumper.dashboard.pose_history import PoseHistory
from thumper.dashboard.rate_limit import RateLimit

STOP = {"x_m": 0.0, "y_m": 0.0, "yaw_rad": None, "wait_s": 0.0, "record": False, "beep": False}
GOAL = {"kind": "goal", "x_m": 1.0, "y_m": -2.0, "yaw_rad": None}


def test_valid_messages_are_parsed() -> None:
    assert parse_message('{"kind": "estop"}') == EStop(kind="estop")
    assert parse_message('{"kind": "heartbeat", "n": 7}') == PageHeartbeat(kind="heartbeat", n=7)
    assert parse_message(json.dumps(GOAL)) == GoalMessage(kind="goal", x_m=1.0, y_m=-2.0, yaw_rad=None)
    teleop = parse_message('{"kind": "teleop", "forward": 1, "left": -0.5, "turbo": false}')
    assert teleop == Teleop(kind="teleop", forward=1.0, left=-0.5, turbo=False)


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"kind": "shell", "command": "reboot"},
        {**GOAL, "x_m": 1e6},
        {**GOAL, "x_m": "1"},
        {**GOAL, "x_m": None},
        {**GOAL, "path": "/etc/passwd"},
        {"kind": "goal", "x_m": 1.0},
        {"kind": "teleop", "forward": 1.5, "left": 0.0, "turbo": False},
        {"kind": "teleop", "forward": 0.5, "left": 0.0, "turbo": 1},
        {"kind": "command", "name": "format"},
        {"kind": "waypoints", "goals": []},
        {"kind": "waypoints", "goals": [[1.0, 2.0]]},
        {"kind": "waypoints", "goals": [STOP] * 51},
        {"kind": "waypoints", "goals": [STOP | {"wait_s": -1.0}]},
        {"kind": "waypoints", "goals": [STOP | {"wait_s": 3600.1}]},
        {"kind": "waypoints", "goals": [STOP | {"record": 1}]},
        {"kind": "waypoints", "goals": [STOP | {"beep": 1}]},
        {"kind": "patrol", "places": [], "rounds": 1},
        {"kind": "patrol", "places": ["a"], "rounds": 1001},
        {"kind": "place_goal", "name": ""},
        {"kind": "remove_annotation", "name": "a" * 41},
        {"kind": "add_annotation", "feature": []},
        {"kind": "obstacle", "x_m": 0.0, "y_m": 0.0, "radius_m": 50.0},
    ],
)
def test_all_other_messages_are_refused(message: dict[str, Any]) -> None:
    with pytest.raises(PageMessageError, match="refused"):
        parse_message(json.dumps(message))


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_non_finite_numbers_in_page_messages_are_refused(value: str) -> None:
    with pytest.raises(PageMessageError):
        parse_message(f'{{"kind": "goal", "x_m": {value}, "y_m": 0, "yaw_rad": 0}}')


@given(st.text(max_size=300) | st.binary(max_size=300).map(lambda raw: raw.decode("latin-1")))
def test_any_text_is_parsed_or_refused(text: str) -> None:
    problem = ""
    try:
        parse_message(text)
    except PageMessageError as error:
        problem = str(error)
    assert "\n" not in problem


def test_what_a_refusal_repeats_is_short_and_printable() -> None:
    for text in (5000 * "x", "a\nb\x1b[2J"):
        with pytest.raises(PageMessageError) as refused:
            parse_message(json.dumps({"kind": "estop", text: 1}))
        assert len(str(refused.value)) <= 300
        assert str(refused.value).isprintable()


def test_long_message_is_refused() -> None:
    with pytest.raises(PageMessageError, match="too long"):
        parse_message(" " * 10_000 + '{"kind": "estop"}')


def test_rate_limit() -> None:
    now_s = [0.0]
    limit = RateLimit(10.0, 5, clock=lambda: now_s[0])
    assert [limit.allows() for _ in range(7)] == [True] * 5 + [False] * 2
    now_s[0] = 0.21
    assert [limit.allows() for _ in range(3)] == [True, True, False]


def test_packet_locates_its_arrays() -> None:
    points = np.array([[1.0, 2.0], [3.0, -4.5]])
    packet = encode_packet({"a": 1}, {"picture": b"abc", "points": points})
    length = int.from_bytes(packet[:4], "little")
    header = json.loads(packet[4 : 4 + length])
    body = packet[4 + length :]
    assert header["a"] == 1
    offset, count, kind = header["arrays"]["points"]
    assert (kind, offset % 4, (4 + length) % 4) == ("f4", 0, 0)
    assert np.array_equal(np.frombuffer(body, "<f4", count, offset), points.reshape(-1))
    offset, count, kind = header["arrays"]["picture"]
    assert (kind, body[offset : offset + count]) == ("u1", b"abc")


def test_grid_is_encoded_as_png() -> None:
    from io import BytesIO

    from matplotlib.image import imread

    cells = np.array([[-1, 0, 100], [50, 1, 99]], dtype=np.int8)
    picture = imread(BytesIO(grid_png(cells)), format="png")
    assert np.array_equal(np.round(255 * picture).astype(int), cells.astype(int) + 1)


def test_scan_points_follow_the_robots_motion() -> None:
    track = PoseHistory()
    assert track.in_map(np.zeros((3, 2)), np.zeros(3)).shape == (0, 2)
    track.add(0.0, Pose2(theta_rad=math.pi - 0.1))
    track.add(1.0, Pose2(x_m=1.0, theta_rad=-math.pi + 0.1))  # turns on through pi, not back through zero
    points = track.in_map(np.array([[1.0, 0.0]] * 3), np.array([-5.0, 0.5, 9.0]))
    assert points[0] == pytest.approx((math.cos(math.pi - 0.1), math.sin(math.pi - 0.1)))
    assert points[1] == pytest.approx((0.5 - 1.0, 0.0), abs=1e-12)
    assert points[2] == pytest.approx((1.0 - math.cos(0.1), -math.sin(0.1)))


def test_the_page_sends_exactly_the_accepted_kinds() -> None:
    """Literals in the scripts, without a browser: `kind: "goal"` in an object that a script sends."""
    scripts = Path(page_messages.__file__).parent.joinpath("static").glob("*.js")
    sent = {
        kind for path in scripts for kind in re.findall(r'\bkind: "(\w+)"', path.read_text(encoding="utf-8"))
    }
    accepted = {get_args(model.model_fields["kind"].annotation)[0] for model in get_args(PageMessage)}
    assert sent == accepted


INITIAL = {"kind": "initial_pose", "x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0}
OBSTACLE = {"kind": "obstacle", "x_m": 0.0, "y_m": 0.0, "radius_m": 0.5}
EXPERIMENT = {"kind": "experiment", "name": "step", "lane_m": 1.0}
HEARTBEAT, TELEOP = {"kind": "heartbeat"}, {"kind": "teleop", "forward": 0.0, "left": 0.0, "turbo": False}


@pytest.mark.parametrize(
    ("message", "field", "least", "most", "step"),
    [
        (GOAL, "x_m", -1000.0, 1000.0, 0.1),
        (GOAL, "yaw_rad", -6.2832, 6.2832, 0.001),
        (INITIAL, "yaw_rad", -6.2832, 6.2832, 0.001),
        (TELEOP, "left", -1.0, 1.0, 0.01),
        (OBSTACLE, "radius_m", 0.02, 2.0, 0.01),
        (EXPERIMENT, "lane_m", 0.6, 10.0, 0.1),
        (HEARTBEAT, "n", 0, 2**53 - 1, 1),
    ],
)
def test_every_number_has_its_limits(
    message: dict[str, Any], field: str, least: float, most: float, step: float
) -> None:
    for good in (least, most):
        assert getattr(parse_message(json.dumps({**message, field: good})), field) == good
    for wrong in (least - step, most + step):
        with pytest.raises(PageMessageError, match=field):
            parse_message(json.dumps({**message, field: wrong}))


def test_every_list_and_name_has_its_limits() -> None:
    for goals in ([STOP], [STOP | {"yaw_rad": 1.5, "wait_s": 3600.0, "record": True}] * 50):
        parse_message(json.dumps({"kind": "waypoints", "goals": goals}))
    with pytest.raises(PageMessageError, match="goals"):
        parse_message(json.dumps({"kind": "waypoints", "goals": [{"x_m": 0.0}]}))
    for name in ("a", "a" * 40):
        parse_message(json.dumps({**EXPERIMENT, "name": name}))
    for name in ("", "a" * 41, "../a", "A"):
        with pytest.raises(PageMessageError, match="name"):
            parse_message(json.dumps({**EXPERIMENT, "name": name}))


def test_message_of_8192_characters_is_the_longest() -> None:
    text = '{"kind": "estop"}'
    assert parse_message(text + " " * (8192 - len(text)))
    with pytest.raises(PageMessageError, match="too long"):
        parse_message(text + " " * (8193 - len(text)))


def test_refusal_names_the_field_without_the_value() -> None:
    for text, words in (("[]", "the message"), (json.dumps({**GOAL, "x_m": "secret"}), "x_m")):
        with pytest.raises(PageMessageError, match=f"refused .*{words}") as refusal:
            parse_message(text)
        assert "secret" not in str(refusal.value)
        assert "http" not in str(refusal.value)


def test_messages_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="frozen"):
        parse_message('{"kind": "estop"}').kind = "goal"
