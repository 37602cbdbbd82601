"""The lines of `thumper status`."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest

from thumper.cli import status as command
from thumper.cli.status import _json, earth_text, mode_text
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.ros.status import Status
from thumper.ros.to_json import from_json
from thumper.ros.to_ros import Messages


@pytest.mark.parametrize(
    ("mode", "lost", "text"),
    [
        ("mapping", "", "mapping"),
        ("mapping", "the robot was moved", "mapping; the robot was moved"),
        ("localizing", "", "localizing, pose found"),
        ("localizing", "places look alike", "localizing, searching for the pose; places look alike"),
    ],
)
def test_it_shows_whether_the_pose_is_found(mode: str, lost: str, text: str) -> None:
    assert mode_text({"mode": mode, "lost": lost, "map_doubt": ""}) == text


def test_a_lost_pose_is_given_as_the_reason_once() -> None:
    """The doubt about the map has the same cause."""
    mapping = {"mode": "localizing", "lost": "it explains 38 %", "map_doubt": "is it the right one?"}
    assert mode_text(mapping) == "localizing, searching for the pose; it explains 38 %"
    mapping["lost"] = ""
    assert mode_text(mapping) == "localizing, pose found; is it the right one?"


@pytest.mark.parametrize(
    ("datum", "gps", "text"),
    [
        ("", "off", ""),
        ("at 48 11", "off", "at 48 11"),
        ("at 48 11", "ok", "at 48 11"),
        ("", "the GPS has no fix", "the GPS has no fix"),
        ("at 48 11", "the GPS has no fix", "at 48 11; the GPS has no fix"),
    ],
)
def test_it_shows_the_place_on_earth_of_a_robot_that_may_have_one(datum: str, gps: str, text: str) -> None:
    assert earth_text({"datum": datum, "gps": gps}) == text


def test_a_number_has_no_digits_that_no_sensor_resolves() -> None:
    content = {
        "twist": [4.999947122996673e-10, -4.9e-10, 0.30000000000000004],
        "latitude": 48.26243124,
        "n": 12,
    }
    assert _json(content) == '{"twist": [0.0, 0.0, 0.3], "latitude": 48.26243124, "n": 12}'


class Client:
    """A robot that sends some topics, and waits for its board: it answers no queries."""

    def __init__(self, messages: Mapping[str, Any]) -> None:
        self._messages = messages

    def subscribe(self, topic: str, callback: Callable[[Any], None]) -> None:
        if topic in self._messages:
            callback(self._messages[topic])

    def query(self, *_: object, **__: object) -> Mapping[str, Any]:
        raise ThumperError("it waits for its board")


def shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, as_json: bool, **messages: Any
) -> str:
    """Return what `thumper status` prints for a robot that sends these messages."""

    @contextmanager
    def connect(*_: object) -> Iterator[Client]:
        yield Client(messages)

    monkeypatch.setattr(command, "connect", connect)
    monkeypatch.setattr(command, "LIVE_TIMEOUT_S", 0.01)
    command.status(as_json=as_json)
    return capsys.readouterr().out


M = Messages()
POSE = M.pose(1.0, Pose2(x_m=1.25, y_m=-0.5, theta_rad=math.pi / 2))
BATTERY = from_json("sensor_msgs/msg/BatteryState", {"voltage": 7.4, "present": True})


def test_it_shows_pose_and_battery(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sent = {"status": M.status(Status(time_s=0.0)), "pose": POSE, "battery": BATTERY}
    text = shown(monkeypatch, capsys, as_json=False, **sent)
    assert "\npose     (1.25, -0.50) m, heading 90 degrees\nbattery  7.40 V\n" in text
    content = json.loads(shown(monkeypatch, capsys, as_json=True, **sent))
    assert content["pose"] == pytest.approx({"x_m": 1.25, "y_m": -0.5, "heading_rad": math.pi / 2})
    assert content["battery_V"] == 7.4


def test_what_does_not_arrive_is_left_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    unread = from_json("sensor_msgs/msg/BatteryState", {"voltage": 0.0, "present": False})
    sent = {"status": M.status(Status(time_s=0.0)), "battery": unread}
    text = shown(monkeypatch, capsys, as_json=False, **sent)
    assert "pose" not in text
    assert "battery" not in text
    content = json.loads(shown(monkeypatch, capsys, as_json=True, **sent))
    assert content["pose"] is content["battery_V"] is None


def test_the_goal_in_json_is_null_without_a_goal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for has_goal, goal in ((False, [None, None, None]), (True, [0.0, 2.0, None])):
        status = M.status(Status(time_s=0.0, has_goal=has_goal, goal_y_m=2.0, goal_yaw_rad=math.nan))
        content = json.loads(shown(monkeypatch, capsys, as_json=True, status=status))
        assert [content[f"goal_{name}"] for name in ("x_m", "y_m", "yaw_rad")] == goal
