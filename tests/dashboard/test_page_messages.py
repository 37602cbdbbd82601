"""What a page may ask for, without a browser: everything else is refused before anything looks at it."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.geometry import Pose2
from thumper.dashboard.binary_packet import encode_packet, grid_png
from thumper.dashboard.page_messages import (
    EStop,
    GoalMessage,
    PageHeartbeat,
    PageMessageError,
    Teleop,
    read_order,
)
from thumper.dashboard.pose_track import PoseTrack
from thumper.dashboard.rate_limit import RateLimit

GOAL = {"kind": "goal", "x_m": 1.0, "y_m": -2.0, "yaw_rad": None}


def test_orders_are_read() -> None:
    assert read_order('{"kind": "estop"}') == EStop(kind="estop")
    assert read_order('{"kind": "heartbeat", "n": 7}') == PageHeartbeat(kind="heartbeat", n=7)
    assert read_order(json.dumps(GOAL)) == GoalMessage(kind="goal", x_m=1.0, y_m=-2.0, yaw_rad=None)
    teleop = read_order('{"kind": "teleop", "forward": 1, "left": -0.5, "turbo": false}')
    assert teleop == Teleop(kind="teleop", forward=1.0, left=-0.5, turbo=False)


@pytest.mark.parametrize(
    "order",
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
        {"kind": "waypoints", "places": []},
        {"kind": "waypoints", "places": [[1.0, 2.0, 3.0]]},
        {"kind": "waypoints", "places": [[0.0, 0.0]] * 51},
        {"kind": "obstacle", "x_m": 0.0, "y_m": 0.0, "radius_m": 50.0},
    ],
)
def test_everything_else_is_refused(order: dict[str, Any]) -> None:
    with pytest.raises(PageMessageError, match="refused"):
        read_order(json.dumps(order))


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_no_order_holds_what_is_no_number(value: str) -> None:
    with pytest.raises(PageMessageError):
        read_order(f'{{"kind": "goal", "x_m": {value}, "y_m": 0, "yaw_rad": 0}}')


@given(st.text(max_size=300) | st.binary(max_size=300).map(lambda raw: raw.decode("latin-1")))
def test_any_text_is_an_order_or_refused(text: str) -> None:
    problem = ""
    try:
        read_order(text)
    except PageMessageError as error:
        problem = str(error)
    assert "\n" not in problem


def test_a_long_order_is_refused_unread() -> None:
    with pytest.raises(PageMessageError, match="longer"):
        read_order(" " * 10_000 + '{"kind": "estop"}')


def test_rate_limit() -> None:
    now_s = [0.0]
    limit = RateLimit(10.0, 5, clock=lambda: now_s[0])
    assert [limit.allows() for _ in range(7)] == [True] * 5 + [False] * 2
    now_s[0] = 0.21
    assert [limit.allows() for _ in range(3)] == [True, True, False]


def test_a_packet_says_where_its_arrays_lie() -> None:
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


def test_a_grid_becomes_a_picture() -> None:
    from io import BytesIO

    from matplotlib.image import imread

    cells = np.array([[-1, 0, 100], [50, 1, 99]], dtype=np.int8)
    picture = imread(BytesIO(grid_png(cells)), format="png")
    assert np.array_equal(np.round(255 * picture).astype(int), cells.astype(int) + 1)


def test_each_ray_is_drawn_from_where_it_was_taken() -> None:
    track = PoseTrack()
    assert track.in_map(np.zeros((3, 2)), np.zeros(3)).shape == (0, 2)
    track.add(0.0, Pose2(theta_rad=math.pi - 0.1))
    track.add(1.0, Pose2(x_m=1.0, theta_rad=-math.pi + 0.1))  # turns on through pi, not back through zero
    points = track.in_map(np.array([[1.0, 0.0]] * 3), np.array([-5.0, 0.5, 9.0]))
    assert points[0] == pytest.approx((math.cos(math.pi - 0.1), math.sin(math.pi - 0.1)))
    assert points[1] == pytest.approx((0.5 - 1.0, 0.0), abs=1e-12)
    assert points[2] == pytest.approx((1.0 - math.cos(0.1), -math.sin(0.1)))
