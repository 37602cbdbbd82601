"""A robot at service: what is asked of it over its inbox, with the firmware's own word for what came of it.

Simulated time passes beat by beat; hands and heartbeats run on the clock on the wall.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from thumper.assembly import open_robot
from thumper.config.robot import BoardConfig, LidarConfig, RobotConfig
from thumper.geometry import Pose2, Twist2
from thumper.kinematics import WheelSpeeds
from thumper.link.messages import Fault, State, Telemetry
from thumper.navigation.goal import Goal
from thumper.ros.codec import Message
from thumper.runtime import Progress, Runtime
from thumper.service.requests import (
    Ask,
    Channel,
    EmergencyStop,
    GoTo,
    Heartbeat,
    Order,
    Request,
    Velocity,
)
from thumper_hil.bench import Bench, simulation

START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)
NEAR, FAR = Goal(x_m=1.2, y_m=0.05), Goal(x_m=0.0, y_m=0.05)
AHEAD = Twist2(v_m_s=0.3)
HAND_TIMEOUT_S = 0.3


class Service:
    """A robot and the beats that it lives by."""

    def __init__(self, robot: Runtime, bench: Bench) -> None:
        self.robot, self.bench = robot, bench
        self.events: list[str] = []
        robot.products.add(self._listen)
        robot.desk.takes_goals = True
        self.beats(8)

    def _listen(self, topic: str, _stamp_s: float, message: Message) -> None:
        if topic == "events":
            self.events.append(message.msg)

    def beats(self, count: int) -> None:
        for _ in range(count):
            self.robot.serve_beat()

    def put(self, *requests: Request) -> None:
        for request in requests:
            self.robot.inbox.put(request)
        self.beats(1)

    def until(self, condition: Callable[[], bool], most_beats: int = 300) -> None:
        for _ in range(most_beats):
            if condition():
                return
            self.beats(1)
        raise AssertionError(self.robot.pilot.reason)

    def ask(self, name: str, content: Mapping[str, Any] | None = None) -> dict[str, Any]:
        answers: list[Mapping[str, Any]] = []
        self.put(Ask(name=name, content=content or {}, reply=answers.append))
        (answer,) = answers
        return dict(answer)

    @property
    def telemetry(self) -> Telemetry:
        telemetry = self.robot.senses.telemetry
        assert telemetry is not None
        return telemetry

    @property
    def mode(self) -> str:
        return self.robot.pilot.mode.value


@pytest.fixture
def service() -> Iterator[Service]:
    board = f"sim://service/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = RobotConfig(board=BoardConfig(port=board), lidar=LidarConfig(port="sim://service/lidar"))
    with open_robot(config, START) as robot:
        yield Service(robot, simulation("service"))


def test_it_maps_while_it_stands_disarmed(service: Service) -> None:
    assert service.mode == "idle"
    assert service.telemetry.state is State.DISARMED
    assert (service.robot.mapper.grid().cells >= 0).sum() > 500


def test_waypoints_are_driven_and_the_motors_go_off(service: Service) -> None:
    service.put(GoTo(goals=(NEAR, Goal(x_m=0.9, y_m=0.05))))
    service.until(lambda: service.mode == "idle")
    assert abs(service.bench.truth()[-1, 1] - 0.9) < 0.15
    service.beats(1)
    assert service.telemetry.state is State.DISARMED
    assert any("mission 1 reached" in event for event in service.events)
    assert service.ask("mission/state", {"mission": 1})["leg"] == 1


def test_a_new_goal_takes_the_place_of_the_old_without_a_stop(service: Service) -> None:
    first = service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})["mission"]
    service.beats(15)
    second = service.ask("mission/send", {"x_m": NEAR.x_m, "y_m": NEAR.y_m})["mission"]
    assert service.telemetry.state is State.CLOSED_LOOP
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state", {"mission": first})["state"] == "failed"
    assert service.ask("mission/state", {"mission": second})["state"] == "reached"


def test_cancelling_stops_it(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(15)
    assert service.bench.truth()[-1, 4] > 2.0
    assert service.ask("command", {"command": "cancel"})["text"] == "cancelled; the robot stops"
    service.until(lambda: service.mode == "idle")
    assert abs(service.bench.truth()[-1, 4]) < 0.05
    assert service.ask("mission/state")["reason"] == "cancelled"


def test_a_goal_in_a_wall_is_refused(service: Service) -> None:
    answer = service.ask("mission/send", {"x_m": 1.73 + 0.25, "y_m": 1.2})
    far = service.ask("mission/send", {"x_m": 900.0, "y_m": 0.0})
    assert not far["ok"]
    assert "outside any map" in far["error"]
    assert service.mode == ("driving" if answer["ok"] else "idle")


def test_a_hand_needs_arming_and_reaches_the_firmware_as_manual(service: Service) -> None:
    service.put(Velocity(channel=Channel.GAMEPAD, twist=AHEAD))
    assert service.mode == "idle"
    assert "arm the robot" in service.robot.pilot.reason
    service.put(Order(name="arm"))
    service.beats(2)
    assert (service.mode, service.telemetry.state) == ("holding", State.CLOSED_LOOP)
    for _ in range(15):
        service.put(Velocity(channel=Channel.GAMEPAD, twist=AHEAD))
    assert (service.mode, service.telemetry.state) == ("manual", State.MANUAL)
    assert service.bench.truth()[-1, 4] * 0.062 == pytest.approx(AHEAD.v_m_s, rel=0.2)


def test_letting_go_stops_it_and_so_does_a_pad_that_falls_silent(service: Service) -> None:
    service.put(Order(name="arm"))
    for _ in range(10):
        service.put(Velocity(channel=Channel.TELEOP, twist=AHEAD))
    service.put(Velocity(channel=Channel.TELEOP, twist=Twist2()))
    service.beats(2)
    assert (service.mode, service.telemetry.state) == ("holding", State.CLOSED_LOOP)
    for _ in range(10):
        service.put(Velocity(channel=Channel.GAMEPAD, twist=AHEAD))
    assert service.mode == "manual"
    time.sleep(HAND_TIMEOUT_S)
    service.beats(1)
    assert service.mode == "holding"
    service.beats(15)
    assert abs(service.bench.truth()[-1, 4]) < 0.05


def test_a_hand_overrides_navigation(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)
    service.put(Velocity(channel=Channel.GAMEPAD, twist=Twist2(w_rad_s=0.5)))
    service.put(Velocity(channel=Channel.GAMEPAD, twist=Twist2(w_rad_s=0.5)))
    assert service.telemetry.state is State.MANUAL
    assert "overridden: driven by gamepad" in service.ask("mission/state")["reason"]
    time.sleep(HAND_TIMEOUT_S)
    service.beats(20)
    assert service.mode == "holding"  # it does not drive on by itself


def test_an_emergency_stop_latches_until_cleared(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)
    service.put(EmergencyStop())
    service.beats(1)
    assert service.telemetry.fault is Fault.E_STOP
    assert (service.telemetry.left_pwm, service.telemetry.right_pwm) == (0, 0)
    assert "latched" in service.ask("mission/send", {"x_m": 1.2, "y_m": 0.05})["error"]
    assert not service.ask("command", {"command": "arm"})["ok"]
    assert service.ask("command", {"command": "clear_fault"})["ok"]
    service.beats(1)
    assert service.telemetry.state is State.DISARMED
    assert service.ask("mission/send", {"x_m": 1.2, "y_m": 0.05})["ok"]


def test_without_its_page_a_goal_is_given_up(service: Service) -> None:
    service.put(Heartbeat(source="page"), GoTo(goals=(FAR,), source="page"))
    for _ in range(10):
        service.put(Heartbeat(source="page"))
    assert service.mode == "driving"
    time.sleep(HAND_TIMEOUT_S + 0.01)
    service.beats(2)
    assert service.telemetry.state is State.DISARMED
    assert "page" in service.ask("mission/state")["reason"]
    service.put(Heartbeat(source="page"))
    assert service.mode == "idle"


def test_a_goal_that_waited_while_the_process_hung_is_not_driven(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    woken_s = time.monotonic() + 60.0
    monkeypatch.setattr("thumper.service.desk.time", SimpleNamespace(monotonic=lambda: woken_s))
    service.put(GoTo(goals=(FAR,)), Order(name="arm"))
    assert service.mode == "idle"
    assert "hung" in service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})["error"]
    service.put(EmergencyStop())
    service.beats(2)
    assert service.telemetry.fault is Fault.E_STOP
    service.put(Order(name="clear_fault"))
    woken_s += 1.5
    service.put(GoTo(goals=(FAR,)))
    assert service.mode == "driving"


def test_parameters(service: Service) -> None:
    schema = {spec["name"]: spec for spec in service.ask("parameters/schema")["parameters"]}
    values = service.ask("parameters/get")["values"]
    assert set(schema) == set(values)
    kp = values["kp"]
    changed = service.ask("parameters/set", {"kp": kp + 1.0})["values"]["kp"]
    assert changed == pytest.approx(kp + 1.0, abs=schema["kp"]["step"])
    refused = service.ask("parameters/set", {"ki": 1.0, "kp": 1e6})
    assert "kp = 1000000.0 is refused" in refused["error"]
    assert service.ask("parameters/get")["values"]["ki"] == values["ki"]  # none, or all
    assert service.ask("parameters/revert")["values"]["kp"] == pytest.approx(kp)
    service.put(GoTo(goals=(FAR,)))
    assert "must stand" in service.ask("parameters/save")["error"]


def test_the_wheels_do_not_wait_for_parameters(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated time stands still but where the board is waited for."""
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)
    senses, board, heard_s, ordered_s = service.robot.senses, service.robot.senses.board, [0.0], [0.0]
    hear, order = senses.beat, board.set_wheel_speeds

    def beat(standing_order: Callable[[], None] | None = None) -> bool:
        alive = hear(standing_order)
        heard_s[0] = service.bench.time_s
        return alive

    def set_wheel_speeds(speeds: WheelSpeeds) -> None:
        ordered_s[0] = service.bench.time_s
        order(speeds)

    monkeypatch.setattr(senses, "beat", beat)
    monkeypatch.setattr(board, "set_wheel_speeds", set_wheel_speeds)
    values = service.ask("parameters/get")["values"]
    assert ordered_s == heard_s
    assert service.ask("parameters/set", values)["ok"]
    assert ordered_s == heard_s
    assert service.bench.time_s > heard_s[0]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("mission/send", {"x_m": 1.0}),
        ("mission/send", {"x_m": 1.0, "y_m": True}),
        ("mission/send", {"x_m": 1.0, "y_m": 0.0, "path": "/etc"}),
        ("mission/state", {"mission": 99}),
        ("command", {"command": "reboot"}),
        ("command", {}),
        ("parameters/set", {}),
        ("parameters/set", {"kp": "1"}),
        ("parameters/set", {"nix": 1.0}),
        ("simulator/command", {"speed": 1e9}),
        ("simulator/command", {"fault": "nix", "value": "ok"}),
    ],
)
def test_a_question_that_makes_no_sense_is_answered_with_why(
    service: Service, name: str, content: dict[str, Any]
) -> None:
    answer = service.ask(name, content)
    assert not answer["ok"]
    assert answer["error"]
    assert "internal" not in answer["error"]


def test_a_board_that_was_unplugged_is_found_again_and_the_map_stays(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(15)
    before = service.robot.senses.perception.situation()
    known = (service.robot.mapper.grid().cells >= 0).sum()
    service.bench.fault("board", "unplugged")
    naps: list[float] = []

    def plug_in(nap_s: float) -> None:
        naps.append(nap_s)
        service.bench.advance(service.bench.time_s + nap_s)
        service.bench.fault("board", "ok")

    monkeypatch.setattr(time, "sleep", plug_in)
    service.beats(1)
    monkeypatch.undo()
    assert naps
    service.beats(5)
    after = service.robot.senses.perception.situation()
    assert before is not None
    assert after is not None
    assert after.map_from_base.distance_m(before.map_from_base) < 0.4
    assert (service.robot.mapper.grid().cells >= 0).sum() >= known
    assert service.mode == "idle"
    assert "cable" in service.ask("mission/state")["reason"]
    service.put(GoTo(goals=(NEAR,)))
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"


def test_a_lidar_that_was_unplugged_is_opened_again_once_the_robot_stands(service: Service) -> None:
    first = service.robot.senses.lidar
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)
    service.bench.fault("lidar", "unplugged")
    service.until(lambda: service.mode == "idle")
    assert "lidar" in service.ask("mission/state")["reason"]
    service.beats(60)
    service.bench.fault("lidar", "ok")
    service.until(lambda: "the lidar answers again" in service.events)
    lidar = service.robot.senses.lidar
    assert lidar is not first
    assert lidar.counters.scans > 10  # counted on
    assert lidar.counters.restarts > 0
    service.beats(10)
    service.put(GoTo(goals=(NEAR,)))
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"


def test_a_part_that_breaks_stops_the_robot_and_not_its_process(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)

    def broken(*_: object) -> None:
        raise IndexError("no such cell")

    monkeypatch.setattr(service.robot.senses.perception, "add_scan", broken)
    service.beats(2)
    monkeypatch.undo()
    service.beats(2)
    assert service.telemetry.state is State.DISARMED
    assert "IndexError" in service.ask("mission/state")["reason"]


@pytest.mark.parametrize(
    ("request_", "why"),
    [(Order(name="cancel"), "cancelled"), (EmergencyStop(), "emergency stop")],
    ids=["cancel", "emergency stop"],
)
def test_a_drive_with_a_goal_of_its_own_can_be_stopped_but_not_sent_elsewhere(
    service: Service, request_: Request, why: str
) -> None:
    told = False

    def ask(beat: Progress) -> None:
        nonlocal told
        if beat.time_s > 1.5 and not told:
            told = True
            service.robot.inbox.put(GoTo(goals=(NEAR,)))
            service.robot.inbox.put(request_)

    result = service.robot.drive_to(FAR, ask)
    assert not result.reached
    assert result.interrupted  # a command that would drive on must not
    assert result.reason == why
    assert any("goals of its own" in event for event in service.events)
    assert abs(service.bench.truth()[-1, 4]) < 0.05
