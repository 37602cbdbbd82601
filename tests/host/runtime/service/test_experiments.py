"""Experiments as the robot's loop runs them; the tuning package tests what they drive."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from thumper.board.board import TelemetrySample
from thumper.board.messages import State
from thumper.board.options import BoardOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.ros.services import StartExperiment
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.heartbeats import TIMEOUT_S
from thumper.runtime.loop import RobotLoop
from thumper.runtime.service.experiments import ExperimentContext, Experiments, LentBoard


@pytest.fixture
def robot() -> Iterator[RobotLoop]:
    config = RobotConfig(
        board=BoardOptions(port="sim://thinking/board"), lidar=LidarOptions(port="sim://thinking/lidar")
    )
    with open_robot(config, Pose2()) as robot:
        yield robot


def test_a_stop_does_not_wait_for_the_computation(
    robot: RobotLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    may_end, computed = threading.Event(), threading.Event()
    events: list[str] = []

    def compute(_name: str) -> None:
        may_end.wait(20.0)
        computed.set()

    def listen(topic: str, _time_s: float, message: object) -> None:
        if topic == "events":
            events.append(getattr(message, "msg", ""))

    def step_and_cancel(samples: list[TelemetrySample]) -> None:
        step_lent(samples)
        experiments.stop("cancelled")

    step_lent = robot.control_cycle.step_lent
    monkeypatch.setattr("thumper.runtime.service.experiments._load", compute)
    monkeypatch.setattr(robot.control_cycle, "step_lent", step_and_cancel)
    robot.publisher.add_sink(listen)
    experiments = robot.request_handler.experiments
    experiments.request(StartExperiment(name="tune", lane_m=1.2), "me")
    robot.step()
    experiments.run(robot.control_cycle)
    try:
        assert (events[-1], computed.is_set()) == ("tune: cancelled", False)
    finally:
        may_end.set()


def test_the_result_is_reason_event_and_last_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    events: list[str] = []
    reasons: list[str] = []
    result = "the board uses the new gains"

    def experiment(context: ExperimentContext) -> None:
        context.report_progress(1, 2, "driving")
        context.report_line("left: 3 rad/s")
        context.report_result(result)

    board = SimpleNamespace(identity=None, restarted=False, poll=lambda _timeout_s: [])
    loop: Any = SimpleNamespace(
        inputs=SimpleNamespace(board=board, telemetry=None),
        publisher=SimpleNamespace(publish_event=events.append, experiment=""),
        step_lent=lambda _samples: None,
        stop=reasons.append,
    )
    monkeypatch.setattr("thumper.runtime.service.experiments._load", lambda _name: experiment)
    experiments = Experiments()
    experiments.request(StartExperiment(name="tune", lane_m=1.2), "me")
    experiments.run(loop)
    state = experiments.state()
    assert (state.what, state.lines, state.problem) == (result, ["left: 3 rad/s", result], "")
    assert events == ["tune begins", f"tune: {result}"]
    assert reasons == [result]


@pytest.mark.parametrize("is_open", [True, False])
def test_a_page_is_lost_only_if_nothing_of_it_arrived_during_a_slow_cycle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_open: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    cycles = iter((1.1 * TIMEOUT_S, 0.0))

    def heartbeat() -> None:
        experiments.heartbeats.record("page", time.monotonic())

    def process_requests() -> None:
        if is_open:
            heartbeat()

    def experiment(context: ExperimentContext) -> None:
        context.board.poll(0.0)  # slow: the next heartbeats wait for the next cycle
        context.board.poll(0.0)  # it follows at once, before the bus has queued them
        context.report_result("done")

    telemetry = SimpleNamespace(state=State.CLOSED_LOOP)
    board = SimpleNamespace(identity=None, restarted=False, poll=lambda _timeout_s: [])
    loop: Any = SimpleNamespace(
        inputs=SimpleNamespace(board=board, telemetry=telemetry),
        publisher=SimpleNamespace(publish_event=lambda _text: None, experiment=""),
        step_lent=lambda _samples: time.sleep(next(cycles)),
        process_requests=process_requests,
        stop=lambda _reason: None,
    )
    monkeypatch.setattr("thumper.runtime.service.experiments._load", lambda _name: experiment)
    experiments = Experiments()
    experiments.request(StartExperiment(name="tune", lane_m=1.2), "page")
    heartbeat()
    experiments.run(loop)
    problem = experiments.state().problem
    assert problem == "" if is_open else problem.startswith("the experiment stopped: the page")


def test_a_lent_board_is_the_board_and_runs_the_loop_at_each_poll(robot: RobotLoop) -> None:
    seen: list[TelemetrySample] = []
    board = robot.inputs.board
    lent = LentBoard(board, seen.extend)
    samples = lent.poll(0.5)
    assert samples
    assert seen == samples
    assert (lent.identity, lent.port, lent.restarted) == (board.identity, board.port, False)
    assert lent.get_parameter("ks") == board.get_parameter("ks")
    lent.close()
    assert board.poll(0.5)  # still open: the loop needs it
