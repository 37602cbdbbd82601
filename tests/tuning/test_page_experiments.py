"""Experiments on a running robot, with the real firmware in simulation at full speed."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from thumper.board.messages import Fault, State
from thumper.board.options import BoardOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.runtime.assembly import open_robot
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import EmergencyStop, Heartbeat, Query, RobotCommand
from thumper_hil.bench import simulation
from thumper_tuning.cli.page_experiments import WholeProgress


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RobotLoop]:
    monkeypatch.chdir(tmp_path)
    config = RobotConfig(
        board=BoardOptions(port="sim://service/board?world=hall&seed=3"),
        lidar=LidarOptions(port="sim://service/lidar"),
    )
    with open_robot(config, Pose2()) as robot:
        for _ in range(5):
            robot.cycle()
        robot._rate.set_speed(20.0)
        yield robot


def ask(robot: RobotLoop, name: str, content: Mapping[str, Any], source: str = "me") -> dict[str, Any]:
    answers: list[Mapping[str, Any]] = []
    robot.request_queue.put(Query(name=name, content=content, reply=answers.append, source=source))
    robot.request_handler.process_pending()
    return dict(answers[0])


def interrupt(robot: RobotLoop, monkeypatch: pytest.MonkeyPatch, *requests: Any) -> None:
    """Queue requests after the robot has been driving for 40 cycles."""
    cycles = 0
    process = robot.request_handler.process_pending

    def processing() -> None:
        nonlocal cycles
        cycles += 1
        if cycles == 40:
            for request in requests:
                robot.request_queue.put(request)
        process()

    monkeypatch.setattr(robot.request_handler, "process_pending", processing)


def state_after(robot: RobotLoop) -> State:
    robot.cycle()
    assert robot.inputs.telemetry is not None
    return robot.inputs.telemetry.state


@pytest.mark.slow
def test_motors_are_identified(robot: RobotLoop) -> None:
    assert ask(robot, "experiment/start", {"name": "identify", "lane_m": 1.2})["text"] == "identify begins"
    robot.cycle()
    state = ask(robot, "experiment/state", {})
    assert (state["running"], state["problem"]) == ("", "")
    assert [line.partition(":")[0] for line in state["lines"] if ": gain" in line] == ["left", "right"]
    assert Path("out/experiments/identification.csv").stat().st_size > 10_000
    assert state_after(robot) is State.DISARMED


@pytest.mark.parametrize(
    ("request_", "problem"),
    [(RobotCommand(name="cancel"), "stopped on request"), (EmergencyStop(), "emergency stop")],
)
def test_a_request_stops_the_experiment(
    robot: RobotLoop, monkeypatch: pytest.MonkeyPatch, request_: Any, problem: str
) -> None:
    ask(robot, "experiment/start", {"name": "tune", "lane_m": 1.2})
    interrupt(robot, monkeypatch, request_)
    robot.cycle()
    state = ask(robot, "experiment/state", {})
    assert state["problem"] == problem
    assert 0.0 < state["share"] < 0.2
    assert state["what"].startswith("measuring the motors: PWM ")
    assert state_after(robot) is (State.FAULT if problem == "emergency stop" else State.DISARMED)


def test_while_an_experiment_drives_the_status_says_so_and_no_file_is_deleted(
    robot: RobotLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    replies: list[Mapping[str, Any]] = []
    statuses: list[tuple[str, str]] = []

    def sink(topic: str, _time_s: float, message: Any) -> None:
        if topic == "status":
            statuses.append((message.mode, message.reason))

    robot.publisher.add_sink(sink)
    delete = Query(name="library/delete", content={"name": "kitchen"}, reply=replies.append, source="me")
    ask(robot, "experiment/start", {"name": "tune", "lane_m": 1.2})
    interrupt(robot, monkeypatch, delete, RobotCommand(name="cancel"))
    robot.cycle()
    assert ("experiment", "tune") in statuses
    assert replies[0]["error"] == "tune is running: cancel it first"
    statuses.clear()
    while not statuses:
        robot.cycle()
    assert statuses[-1][0] == "idle"


def test_a_disconnected_page_stops_its_experiment(robot: RobotLoop) -> None:
    robot.request_queue.put(Heartbeat(source="page"))
    ask(robot, "experiment/start", {"name": "tune", "lane_m": 1.2}, source="page")
    robot.cycle()
    problem = ask(robot, "experiment/state", {})["problem"]
    assert problem.startswith("the experiment stopped: the page or program that started it was closed")
    assert state_after(robot) is State.DISARMED


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"name": "identify"},
        {"name": "identify", "lane_m": 0.1},
        {"name": "identify", "lane_m": float("nan")},
        {"name": "/bin/sh", "lane_m": 1.2},
    ],
)
def test_an_invalid_request_is_rejected(robot: RobotLoop, content: dict[str, Any]) -> None:
    assert not ask(robot, "experiment/start", content)["ok"]
    assert robot.request_handler.experiments.requested == ""


def test_an_obstacle_in_the_lane_refuses_an_experiment(robot: RobotLoop) -> None:
    simulation("service").add_pillar(Pose2(x_m=0.8, y_m=0.1), 0.1)
    for _ in range(5):
        robot.cycle()
    error = ask(robot, "experiment/start", {"name": "tune", "lane_m": 1.2})["error"]
    assert error.startswith("an obstacle is 0.7 m ahead of the robot's centre, and the lane needs 1.2 m ")
    assert ask(robot, "experiment/start", {"name": "tune", "lane_m": 0.6})["ok"]


def test_nothing_else_moves_the_robot_once_an_experiment_is_requested(robot: RobotLoop) -> None:
    """It would start by itself, at the end of the drive."""
    assert ask(robot, "experiment/start", {"name": "identify", "lane_m": 1.2})["ok"]
    for name, content in (("command", {"command": "arm"}), ("mission/send", {"x_m": 0.5, "y_m": 0.0})):
        assert ask(robot, name, content)["error"] == "identify is running: cancel it first"


def test_an_experiment_does_not_start_after_the_board_was_lost(robot: RobotLoop) -> None:
    """By then nobody expects it."""
    bench = simulation("service")
    save = Query(name="parameters/save", content={}, reply=lambda _: None, source="me")
    robot.request_queue.put(save)  # the experiment waits until it is done
    ask(robot, "experiment/start", {"name": "identify", "lane_m": 1.2})
    bench.fault("board", "unplugged")
    robot.cycle()
    bench.fault("board", "ok")
    assert robot.request_handler.experiments.requested == ""
    assert "board" in ask(robot, "experiment/state", {})["problem"]


def test_only_one_experiment_at_a_time(robot: RobotLoop) -> None:
    request = {"name": "identify", "lane_m": 1.2}
    assert ask(robot, "experiment/start", request)["ok"]
    assert "is running" in ask(robot, "experiment/start", request)["error"]
    ask(robot, "command", {"command": "cancel"})
    assert robot.request_handler.experiments.requested == ""  # cancelled before it started
    assert robot.inputs.telemetry is not None
    assert robot.inputs.telemetry.fault is Fault.NONE
    assert not ask(robot, "experiment/report", {})["ok"]


def test_progress_of_tuning_never_goes_back() -> None:
    shares: list[float] = []
    progress = WholeProgress(lambda done, total, what: shares.append(done / total))
    for title in ("measuring the motors: pulses", "computing", "computing the gains"):
        progress.report_progress(0, 0, title)
    for gains in ("old", "new"):
        progress.report_progress(0, 0, "driving back to the start")
        for done in range(101):
            progress.report_progress(done, 100, f"driving with the {gains} gains: {done}")
    driven = shares[-1]
    progress.report_progress(0, 0, "comparing the drives and writing the report")
    assert shares == sorted(shares)
    assert 0.9 < driven == shares[-1] < 1.0  # the report takes seconds
