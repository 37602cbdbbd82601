"""Ports of a running robot vanish and return, in any order; it stops, says so and keeps its map."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import pytest

from tests.e2e.service import FAR, NEAR, START, Service
from tests.variants import some_of
from thumper.board.messages import Fault, State
from thumper.board.options import BoardOptions
from thumper.camera.options import CameraOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.gps.options import GpsOptions
from thumper.imu.options import ImuOptions
from thumper.lidar.options import LidarOptions
from thumper.runtime.assembly import open_robot
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import EmergencyStop, GoTo, RobotCommand
from thumper_hil.bench import simulation
from thumper_hil.bench.registry import close_device, open_device

BACK_S = 5.0
ORDERS = {
    "lidar": ("lidar-", "lidar+"),
    "board": ("board-", "board+"),
    "both, lidar back first": ("lidar-", "board-", "lidar+", "board+"),
    "both, board back first": ("board-", "lidar-", "board+", "lidar+"),
    "lidar again while it is away": ("lidar-", "lidar+", "lidar-", "lidar+"),
    "board again while it is away": ("board-", "lidar-", "board+", "board-", "lidar+", "board+"),
}
MODELS = ("urg04lx", "ld19", "rplidar_a2")
# Each sequence with one model, driving or at rest; the other combinations are slow.
CASES = [
    pytest.param(
        model,
        order,
        is_driving,
        id=f"{model}, {name}, {'driving' if is_driving else 'at rest'}",
        marks=[] if is_driving == number % 2 and MODELS[number % 3] == model else [pytest.mark.slow],
    )
    for model, (number, (name, order)) in product(MODELS, enumerate(ORDERS.items()))
    for is_driving in (False, True)
]


@pytest.fixture
def pluggable(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Service]]:
    """Return a function that makes a running robot with a lidar of the given model."""
    robots: list[AbstractContextManager[RobotLoop]] = []
    held: list[str] = []

    def make(model: str) -> Service:
        name = f"unplugged{model}"
        board = f"sim://{name}/board?world=lab&lidar={model}&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
        lidar = LidarOptions(port=f"sim://{name}/lidar", model=model)  # type: ignore[arg-type]
        opened = open_robot(RobotConfig(board=BoardOptions(port=board), lidar=lidar), START)
        held.append(name)
        service = Service(opened.__enter__(), simulation(name))
        open_device(name, "witness", {})  # keeps the simulation while both ports are closed
        robots.append(opened)
        for part in ("service.request_handler", "service.request_queue", "drive.drive_manager"):
            monkeypatch.setattr(f"thumper.runtime.{part}.time", SimpleNamespace(monotonic=service.wall_s))
        monkeypatch.setattr(time, "sleep", lambda nap_s: service.bench.advance(service.bench.time_s + nap_s))
        service.run_cycles(8)
        return service

    yield make
    for opened in robots:
        opened.__exit__(None, None, None)
    for name in held:
        close_device(name, "witness")


def run_for(service: Service, duration_s: float) -> None:
    until_s = service.bench.time_s + duration_s
    service.until(lambda: service.bench.time_s >= until_s)


def is_back(service: Service) -> bool:
    state = service.robot.inputs.estimator.state()
    is_telling = service.robot.inputs.board.now_s() - (state.time_s if state else 0.0) < 0.3
    return state is not None and is_telling and state.scan_age_s < 0.35


@pytest.mark.parametrize(("model", "order", "is_driving"), CASES)
def test_ports_come_and_go(
    pluggable: Callable[[str], Service], model: str, order: tuple[str, ...], is_driving: bool
) -> None:
    service = pluggable(model)
    if is_driving:
        service.put(GoTo(goals=(FAR,)))
        service.run_cycles(12)
    known = (service.robot.mapper.grid().cells >= 0).sum()
    for move in order:
        device, plugged = move[:-1], move[-1] == "+"
        service.bench.fault(device, "ok" if plugged else "unplugged")
        run_for(service, 2.0)
    back_s = service.bench.time_s - 2.0
    service.until(lambda: is_back(service))
    assert service.bench.time_s - back_s < BACK_S
    assert (service.robot.mapper.grid().cells >= 0).sum() >= known
    assert not [text for text in service.events if "internal error" in text]
    for device in {move[:-1] for move in order}:
        assert any(f"the {device} answers again" in text for text in service.events)
        assert any(device in text and "again" not in text for text in service.events)
    assert service.mode == "idle"
    service.put(GoTo(goals=(NEAR,)))
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"
    assert service.bench.contacts == 0


def armed_without_lidar(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    service.bench.fault("lidar", "unplugged")
    run_for(service, 2.0)
    assert service.mode == "holding"
    service.bench.fault("lidar", "ok")


@pytest.mark.parametrize("model", MODELS)
def test_the_lidar_of_an_armed_robot_comes_back(pluggable: Callable[[str], Service], model: str) -> None:
    service = pluggable(model)
    armed_without_lidar(service)
    back_s = service.bench.time_s
    service.until(lambda: is_back(service))
    assert service.bench.time_s - back_s < BACK_S
    assert "the lidar answers again" in service.events
    assert service.mode == "holding"
    assert service.telemetry.state is State.CLOSED_LOOP
    assert service.telemetry.fault is Fault.NONE


def test_an_emergency_stop_does_not_wait_for_the_lidar(
    pluggable: Callable[[str], Service], monkeypatch: pytest.MonkeyPatch
) -> None:
    service = pluggable("urg04lx")
    armed_without_lidar(service)
    manager, pressed_s = service.robot.drive_manager, list[float]()
    resend = manager.resend_command

    def press_and_resend() -> None:
        if not pressed_s:
            pressed_s.append(service.bench.time_s)
            service.robot.request_queue.put(EmergencyStop())
        resend()

    monkeypatch.setattr(manager, "resend_command", press_and_resend)
    service.until(lambda: service.telemetry.fault is Fault.E_STOP)
    assert service.bench.time_s - pressed_s[0] < 0.3
    service.until(lambda: is_back(service))


def test_the_model_of_the_wheels_is_that_of_the_board_that_returns(
    pluggable: Callable[[str], Service],
) -> None:
    service = pluggable("urg04lx")
    monitor = service.robot.inputs.estimator.drive_train
    assert monitor is not None
    model = monitor.feed_forward
    assert model is not None
    monitor.feed_forward = replace(model, kv=2.0 * model.kv)  # as if the board before had been another one
    service.bench.fault("board", "unplugged")
    run_for(service, 2.0)
    service.bench.fault("board", "ok")
    service.until(lambda: any("the board answers again" in text for text in service.events))
    assert monitor.feed_forward == model


@pytest.mark.parametrize("device", some_of(["imu", "gps", "camera"]))
def test_a_sensor_comes_back(device: str) -> None:
    config = RobotConfig(
        imu=ImuOptions(enabled=device == "imu"),
        gps=GpsOptions(enabled=device == "gps"),
        camera=CameraOptions(enabled=device == "camera"),
    )
    board = f"sim://back{device}/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    with open_robot(with_ports(config, board=board, lidar=f"sim://back{device}/lidar"), START) as robot:
        service = Service(robot, simulation(f"back{device}"))
        run_for(service, 1.0)
        (feed,) = robot.inputs.feeds
        service.bench.fault(device, "unplugged")
        run_for(service, 1.0)
        samples = feed.sensor.counters.samples
        run_for(service, 2.0)
        assert feed.sensor.counters.samples == samples > 0
        service.until(lambda: f"no data from the {device} for 3 s; check its cable" in service.events)
        assert "; no data for 3 s" in feed.summary(robot.inputs.now_s())
        service.bench.fault(device, "ok")
        service.until(lambda: f"the {device} answers again" in service.events)
        back_s = service.bench.time_s
        run_for(service, 2.0)
        assert feed.sensor.counters.restarts == 1
        assert feed.newest.time_s > back_s  # new samples, on the clock of before
        assert feed.newest.time_s <= robot.inputs.now_s()
        assert f"the {device} sends data again" in service.events
        assert "no data" not in feed.summary(robot.inputs.now_s())
        service.put(GoTo(goals=(NEAR,)))
        service.until(lambda: service.mode == "idle")
        assert service.ask("mission/state")["state"] == "reached"
        assert not [text for text in service.events if "internal error" in text]
