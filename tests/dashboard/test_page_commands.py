"""Control of the robot: one page has it, every page can stop the robot. No browser and no server."""

import json
from collections.abc import Mapping
from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.dashboard.page_commands import PageCommands, TeleopLimits
from thumper.dashboard.page_messages import parse_message

TELEOP = '{"kind": "teleop", "forward": 0.5, "left": -1, "turbo": false}'
TURN = '{"kind": "teleop", "forward": 0, "left": 0.5, "turbo": false}'
RELEASE = '{"kind": "teleop", "forward": 0, "left": 0, "turbo": false}'
GOAL = '{"kind": "goal", "x_m": 1, "y_m": 2, "yaw_rad": null}'
STOP = '{"x_m": 1, "y_m": 2, "yaw_rad": null, "wait_s": 0, "record": false, "beep": false}'
WAYPOINTS = '{"kind": "waypoints", "goals": [' + STOP + "]}"
PLACE_GOAL = '{"kind": "place_goal", "name": "kitchen"}'
PATROL = '{"kind": "patrol", "places": ["kitchen", "door"], "rounds": 2}'
EXPERIMENT = '{"kind": "experiment", "name": "tune_wheels", "lane_m": 2}'
POSE = '{"kind": "initial_pose", "x_m": 1, "y_m": 2, "yaw_rad": 0}'
HEARTBEAT = '{"kind": "heartbeat", "n": 1}'
OBSTACLE = '{"kind": "obstacle", "x_m": 1, "y_m": 2, "radius_m": 0.1}'


class Robot:
    """Keeps what the pages send."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, str]] = []  # topic or service, source
        self.messages: list[Any] = []
        self.asked: list[Mapping[str, Any]] = []

    def publish(self, topic: str, message: Any, *, source: str) -> None:
        self.sent.append((topic, source))
        self.messages.append(message)

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        self.sent.append((name, source))
        self.asked.append(payload)
        return {"ok": True, "mission": 1, "text": "done"}


class Pages:
    """The commands of all pages of one robot."""

    def __init__(self) -> None:
        self.robot = Robot()
        self.pose: Pose2 | None = None
        self.commands = PageCommands(self.robot, TeleopLimits(v_m_s=0.8, w_rad_s=2.0), lambda: self.pose)

    def send(self, page: str, text: str) -> list[tuple[str, str]]:
        """Return what the robot gets because of it."""
        self.robot.sent.clear()
        query = self.commands.handle(page, parse_message(text))
        if query is not None:
            query()
        return self.robot.sent


@pytest.mark.parametrize("motion", [TELEOP, TURN, GOAL, PLACE_GOAL, WAYPOINTS, PATROL, EXPERIMENT])
def test_page_that_starts_a_motion_guards_it(motion: str) -> None:
    pages = Pages()
    assert pages.send("a", HEARTBEAT) == []  # it only watches
    sent = pages.send("a", motion)
    assert sent[0] == ("heartbeat", "a")  # first, or the page would count as lost
    assert len(sent) == 2
    assert sent[1][1] == "a"
    assert pages.send("a", HEARTBEAT) == [("heartbeat", "a")]
    assert pages.send("b", HEARTBEAT) == []


@pytest.mark.parametrize("message", [TELEOP, TURN, GOAL, PLACE_GOAL, WAYPOINTS, PATROL, EXPERIMENT, POSE])
def test_second_page_drives_only_after_it_has_taken_control(message: str) -> None:
    pages = Pages()
    pages.send("a", TELEOP)
    with pytest.raises(ThumperError, match="another page controls the robot"):
        pages.send("b", message)
    assert pages.robot.sent == []
    assert pages.commands.operator == "a"
    assert pages.send("b", '{"kind": "take_control"}') == []
    assert pages.send("a", HEARTBEAT) == []  # the robot stops its motion
    assert pages.send("b", message)[-1][1] == "b"
    with pytest.raises(ThumperError, match="another page"):
        pages.send("a", TELEOP)


def test_control_ends_with_the_page() -> None:
    pages = Pages()
    pages.send("a", GOAL)
    pages.commands.on_disconnect("b")
    assert pages.commands.operator == "a"
    pages.commands.on_disconnect("a")
    assert pages.send("a", HEARTBEAT) == []
    assert pages.send("b", TELEOP)[-1] == ("teleop", "b")


def test_every_page_can_stop_and_release() -> None:
    pages = Pages()
    pages.send("a", TELEOP)
    assert pages.send("b", '{"kind": "estop"}') == [("estop", "b")]
    assert pages.robot.messages[-1].data is True
    assert pages.send("b", '{"kind": "command", "name": "cancel"}') == [("command", "b")]
    assert pages.send("b", RELEASE) == [("teleop", "b")]  # zero speed is no motion
    assert pages.commands.operator == "a"


@pytest.mark.parametrize(("turbo", "share"), [("false", 0.5), ("true", 1.0)])
def test_joystick_is_scaled_to_the_limits(turbo: str, share: float) -> None:
    pages = Pages()
    pages.send("a", f'{{"kind": "teleop", "forward": 0.5, "left": -1, "turbo": {turbo}}}')
    twist = pages.robot.messages[-1].twist
    assert (twist.linear.x, twist.angular.z) == pytest.approx((share * 0.4, share * -2.0))


def test_the_joystick_overrides_the_assistance_on_request() -> None:
    pages = Pages()
    assert ("override", "a") not in pages.send("a", TELEOP)
    held = '{"kind": "teleop", "forward": 0.5, "left": 0, "turbo": false, "override": true}'
    assert pages.send("a", held)[-2:] == [("override", "a"), ("teleop", "a")]
    assert pages.robot.messages[-2].data is True


def test_waypoints_are_a_mission_with_headings_only_where_they_are_set() -> None:
    pages = Pages()
    turned = STOP.replace("null", "1.5")
    pages.send("a", f'{{"kind": "waypoints", "goals": [{STOP}, {turned}]}}')
    goals = pages.robot.asked[-1]["goals"]
    assert [goal.get("yaw_rad") for goal in goals] == [None, 1.5]
    assert "yaw_rad" not in goals[0]


def test_anyone_changes_the_map_but_only_by_a_valid_feature() -> None:
    pages = Pages()
    place = {
        "type": "Feature",
        "properties": {"kind": "place", "name": "sofa"},
        "geometry": {"type": "Point", "coordinates": [1.0, 2.0]},
    }
    pages.send("a", GOAL)
    assert pages.send("b", json.dumps({"kind": "add_annotation", "feature": place})) == [
        ("annotation/add", "b")
    ]
    removal = '{"kind": "remove_annotation", "name": "sofa"}'
    assert pages.send("b", removal) == [("annotation/remove", "b")]
    place["properties"] = {"kind": "place", "name": "7"}
    with pytest.raises(ThumperError, match="'7' is a number"):
        pages.send("a", json.dumps({"kind": "add_annotation", "feature": place}))


def test_obstacle_needs_the_pose() -> None:
    pages = Pages()
    with pytest.raises(ThumperError, match="pose is not known"):
        pages.send("a", OBSTACLE)
    pages.pose = Pose2()
    assert pages.send("a", OBSTACLE) == [("simulator/command", "a")]
    assert pages.commands.operator == ""
