"""Queries to a running robot and their answers."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from tests.e2e.service import FAR, Service
from thumper.board.messages import Fault, State
from thumper.common.kinematics import WheelSpeeds
from thumper.odometry.drive_train import DriveTrainEstimate, Estimate, WheelEstimate
from thumper.runtime.requests import GoTo, RobotCommand
from thumper.runtime.service import board_parameters


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
    assert "must be stationary" in service.ask("parameters/save")["error"]


def test_parameters_of_which_the_board_refuses_one_all_stay(service: Service) -> None:
    """While armed it refuses those that describe the robot, whatever their order in the query."""
    before = service.ask("parameters/get")["values"]
    wanted = {"kp": 9.0, "track": 300.0, "ki": 3.0, "battery_cells": 3.0, "ks": 20.0}
    service.put(RobotCommand(name="arm"))
    assert "it is armed; disarm it first" in service.ask("parameters/set", wanted)["error"]
    assert service.ask("parameters/get")["values"] == before
    assert service.events[-1] == "armed"
    service.put(RobotCommand(name="disarm"))
    values = service.ask("parameters/set", wanted)["values"]
    assert {name: round(value) for name, value in values.items()} == wanted
    assert service.events[-2:] == ["disarmed", f"parameters set: {board_parameters.described(values)}"]


def test_the_log_shows_parameters_as_precisely_as_the_wire_does() -> None:
    values = {"kp": 7.999420166015625, "acceleration": 8.05, "track": 245.0}
    assert board_parameters.described(values) == "kp 8.0, acceleration 8.05, track 245"


def test_nothing_arms_the_board_between_two_parameters_of_the_robot(service: Service) -> None:
    """Else the second would be refused, and the first would stay."""
    job = board_parameters.change(
        service.robot.drive_manager.board, {"counts_per_rev": 960.0, "track": 300.0}
    )
    next(job)
    service.put(RobotCommand(name="arm"))
    for _ in job:
        pass
    values = service.ask("parameters/get")["values"]
    assert (values["counts_per_rev"], values["track"]) == (960.0, 300.0)


def test_the_wheels_are_compared_with_the_parameters_of_the_board(service: Service) -> None:
    assert service.ask("wheels/state") == {
        "ok": True,
        "text": "not determined yet; drive at several speeds",
        "drift": "",
        "values": {},
    }
    monitor = service.robot.inputs.estimator.drive_train
    assert monitor is not None
    assert monitor.feed_forward is not None
    kv = monitor.feed_forward.kv
    assert kv == pytest.approx(service.ask("parameters/get")["values"]["kv"])
    service.ask("parameters/set", {"kv": kv + 2.0})
    assert monitor.feed_forward.kv == pytest.approx(kv + 2.0, abs=0.01)
    service.ask("parameters/revert")
    assert monitor.feed_forward.kv == pytest.approx(kv)
    nothing = WheelEstimate(gain=None, time_constant_s=None, friction=None)
    monitor.estimate = DriveTrainEstimate(mean=nothing, left=nothing, right=nothing)
    assert service.ask("wheels/state")["text"] == "not determined yet; drive at several speeds"
    wheels = WheelEstimate(gain=Estimate(0.05, 1e-4), time_constant_s=None, friction=Estimate(40.0, 0.5))
    monitor.estimate = DriveTrainEstimate(mean=wheels, left=wheels, right=wheels)
    reply = service.ask("wheels/state")
    assert (
        reply["text"]
        == "gain 0.05 +- 0.0001 rad/s per PWM, time constant not determined, friction 40 +- 0.5 PWM"
    )
    assert reply["values"]["left_friction_pwm"] == 40.0
    assert "mean_time_constant_s" not in reply["values"]
    assert "40 PWM against friction" in reply["drift"]
    service.run_cycles(1)
    assert sum("40 PWM against friction" in event for event in service.events) == 1
    service.run_cycles(3)
    assert sum("40 PWM against friction" in event for event in service.events) == 1


def test_the_status_distinguishes_heading_zero_from_none(service: Service) -> None:
    headings_rad: list[float] = []
    service.robot.publisher.add_sink(
        lambda topic, _stamp_s, message: (
            headings_rad.append(message.goal_yaw_rad) if topic == "status" else None
        )
    )
    place = {"x_m": FAR.x_m, "y_m": FAR.y_m}
    assert service.ask("mission/send", place)["ok"]
    assert math.isnan(headings_rad[-1])
    assert service.ask("mission/send", {**place, "yaw_rad": 0.0})["ok"]
    assert headings_rad[-1] == 0.0


def test_a_failed_save_is_not_reported_as_saved(service: Service) -> None:
    service.bench.fault("line.loss", 1.0)
    saved = "parameters saved on the board"
    assert not service.ask("parameters/save")["ok"]
    assert saved not in service.events
    service.bench.fault("line.loss", 0.0)
    service.until(lambda: service.ask("parameters/save")["ok"])  # the board must be found again
    assert saved in service.events


def test_a_save_while_armed_does_not_lose_the_link(service: Service) -> None:
    """The first one writes every byte of an erased EEPROM, in 0.23 s."""
    assert service.ask("command", {"command": "arm"})["ok"]
    service.run_cycles(3)
    assert service.ask("parameters/save")["ok"]
    service.run_cycles(3)
    assert (service.telemetry.state, service.telemetry.fault) == (State.CLOSED_LOOP, Fault.NONE)


def test_parameter_queries_do_not_delay_the_wheels(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated time advances only while the host waits for the board."""
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    inputs, board, read_s, sent_s = service.robot.inputs, service.robot.inputs.board, [0.0], [0.0]
    read_inputs, send_speeds = inputs.read, board.set_wheel_speeds

    def read(resend_command: Callable[[], None] | None = None) -> bool:
        alive = read_inputs(resend_command)
        read_s[0] = service.bench.time_s
        return alive

    def set_wheel_speeds(speeds: WheelSpeeds) -> None:
        sent_s[0] = service.bench.time_s
        send_speeds(speeds)

    monkeypatch.setattr(inputs, "read", read)
    monkeypatch.setattr(board, "set_wheel_speeds", set_wheel_speeds)
    values = service.ask("parameters/get")["values"]
    assert sent_s == read_s
    gains = {name: values[name] for name in ("kp", "ki")}  # geometry only while disarmed
    assert service.ask("parameters/set", gains)["ok"]
    assert sent_s == read_s
    assert service.bench.time_s > read_s[0]


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
def test_invalid_queries_are_answered_with_the_reason(
    service: Service, name: str, content: dict[str, Any]
) -> None:
    answer = service.ask(name, content)
    assert not answer["ok"]
    assert answer["error"]
    assert "internal" not in answer["error"]


def test_a_mission_of_several_goals(service: Service) -> None:
    refused: tuple[dict[str, Any], ...] = ({}, {"goals": []}, {"goals": [1]}, {"goals": [{"x_m": 1.0}]})
    for wrong in refused:
        assert not service.ask("mission/follow", wrong)["ok"]
    goals = [{"x_m": 1.5, "y_m": 0.07}, {"x_m": 1.2, "y_m": 0.05}]
    number = service.ask("mission/follow", {"goals": goals})["mission"]
    state = service.ask("mission/state", {"mission": number})
    assert (state["state"], state["leg"], state["legs"]) == ("driving", 0, 2)
    service.until(lambda: service.ask("mission/state")["state"] == "reached")
    assert service.ask("mission/state")["leg"] == 1


def test_a_mission_beeps_on_arrival_and_records_while_it_waits(service: Service) -> None:
    commands: list[str] = []
    for name in ("record_start", "record_stop"):
        service.robot.request_handler.handlers[name] = partial(_note, commands, name)
    goals = [
        {"x_m": 0.5, "y_m": 0.0, "yaw_rad": 0.5, "wait_s": 1.0, "record": True, "beep": True},
        {"x_m": 0.5, "y_m": 0.0},
    ]
    service.ask("mission/follow", {"goals": goals})
    service.until(lambda: bool(commands))
    assert commands == ["record_start"]
    state = service.robot.inputs.estimator.state()
    assert state is not None
    assert state.map_from_base.theta_rad == pytest.approx(0.5, abs=0.2)
    service.until(lambda: service.ask("mission/state")["state"] == "reached")
    assert commands == ["record_start", "record_stop"]
    assert [text for text in service.events if text.startswith("beep")] == ["beep at waypoint 1 of 2"]


def _note(seen: list[str], name: str) -> str:
    seen.append(name)
    return name


def test_clear_costmaps_forgets_remembered_obstacles(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(20)
    memory = service.robot.drive_manager.navigator._parts.model._planning_memory
    remembered = len(memory._points_m)
    assert "forgotten" in service.ask("command", {"command": "clear_costmaps"})["text"]
    assert len(memory._points_m) < remembered
