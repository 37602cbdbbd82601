"""A running robot that loses a part: it stops, reports why and recovers."""

import signal
import sys
import time
from dataclasses import replace
from itertools import pairwise
from types import FrameType
from typing import Any

import pytest

from tests.e2e.service import FAR, NEAR, Service
from thumper.board.messages import Fault, State
from thumper.common.errors import ThumperError
from thumper.navigation.navigator import NavigationOutput
from thumper.runtime.requests import EmergencyStop, GoTo, RobotCommand
from thumper.runtime.state_estimator import RobotState, StateEstimator


def test_a_reconnected_board_keeps_the_map(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(15)
    before = service.robot.inputs.estimator.state()
    known = (service.robot.mapper.grid().cells >= 0).sum()
    service.bench.fault("board", "unplugged")
    with monkeypatch.context() as patch:
        patch.setattr(time, "sleep", lambda nap_s: service.bench.advance(service.bench.time_s + nap_s))
        service.run_cycles(10)
        refused = service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})  # answered while it is lost
        assert "cable" in refused["error"]
        service.bench.fault("board", "ok")
        service.until(lambda: "the board answers again; the motors are off" in service.events)
    service.run_cycles(5)
    after = service.robot.inputs.estimator.state()
    assert before is not None
    assert after is not None
    assert after.map_from_base.distance_m(before.map_from_base) < 0.4
    assert (service.robot.mapper.grid().cells >= 0).sum() >= known
    assert service.mode == "idle"
    assert "cable" in service.ask("mission/state")["reason"]
    service.put(GoTo(goals=(NEAR,)))
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"


def test_a_board_of_another_geometry_is_not_taken_back(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It converts counts to speeds, which would be wrong."""

    def another(*_: object) -> None:
        raise ThumperError("the firmware was built for other wheels")

    service.bench.fault("board", "unplugged")
    monkeypatch.setattr(time, "sleep", lambda nap_s: service.bench.advance(service.bench.time_s + nap_s))
    with monkeypatch.context() as patch:
        patch.setattr("thumper.runtime.assembly.geometry_of", another)
        service.run_cycles(2)
        service.bench.fault("board", "ok")
        service.run_cycles(20)
    assert service.events.count("the firmware was built for other wheels") == 1
    assert "the board answers again; the motors are off" not in service.events
    service.until(lambda: "the board answers again; the motors are off" in service.events)


def test_an_emergency_stop_that_was_not_confirmed_is_repeated_after_a_reconnection(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "sleep", lambda nap_s: service.bench.advance(service.bench.time_s + nap_s))
    service.bench.fault("line.loss", 1.0)
    service.put(EmergencyStop())
    assert any("did not confirm the emergency stop" in text for text in service.events)
    service.bench.fault("board", "unplugged")
    service.run_cycles(3)
    service.bench.fault("line.loss", 0.0)
    service.bench.fault("board", "ok")
    service.until(lambda: service.telemetry.fault is Fault.E_STOP)
    service.put(RobotCommand(name="clear_fault"))
    service.run_cycles(5)
    assert service.telemetry.fault is Fault.NONE  # repeated until confirmed, not for ever


def test_scans_that_stay_old_end_the_drive(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lidar whose clock is behind: too old to drive on, too young to be lost."""
    state = type(service.robot.inputs.estimator).state

    def old_scans(estimator: StateEstimator) -> RobotState | None:
        now = state(estimator)
        return now and replace(now, scan_age_s=0.56)

    monkeypatch.setattr(StateEstimator, "state", old_scans)
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    assert service.mode == "driving"
    assert "waiting for the lidar: its newest scan is 0.56 s old" in service.events
    service.until(lambda: service.mode == "idle", max_cycles=70)
    assert "0.56 s old" in service.ask("mission/state")["reason"]


def test_a_starved_computer_stops_rather_than_drives_on_old_data(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each cycle computes for half a second; the firmware would stop and start with each command."""
    manager = service.robot.drive_manager
    update = manager.navigator.update

    def slow(*arguments: Any, **options: Any) -> NavigationOutput:
        service.bench.advance(service.bench.time_s + 0.5)
        return update(*arguments, **options)

    monkeypatch.setattr(manager.navigator, "update", slow)
    start_m = service.robot.inputs.estimator.driven_m
    service.put(GoTo(goals=(FAR,)))
    service.until(lambda: service.mode == "idle", max_cycles=40)
    assert any("overloaded" in text or "no command for 300 ms" in text for text in service.events)
    assert service.robot.inputs.estimator.driven_m - start_m < 0.02


def test_an_unplugged_lidar_is_reopened_while_the_robot_is_stationary(service: Service) -> None:
    first = service.robot.inputs.lidar.device
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    service.bench.fault("lidar", "unplugged")
    service.until(lambda: service.mode == "idle")
    assert "lidar" in service.ask("mission/state")["reason"]
    assert not [text for text in service.events if "after a gap" in text]
    service.run_cycles(60)
    service.bench.fault("lidar", "ok")
    service.until(lambda: "the lidar answers again" in service.events)
    lidar = service.robot.inputs.lidar
    assert lidar.device is not first
    assert lidar.counters.samples > 10  # the count continues
    assert lidar.counters.restarts > 0
    service.run_cycles(10)
    (gap,) = [text for text in service.events if "after a gap" in text]  # reported once, while the robot runs
    assert "scans arrived after a gap" in gap
    service.run_cycles(10)
    service.put(GoTo(goals=(NEAR,)))
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"


def test_an_internal_error_stops_the_robot_but_not_the_process(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)

    def broken(*_: object) -> None:
        raise IndexError("no such cell")

    with monkeypatch.context() as patch:
        patch.setattr(service.robot.inputs.estimator, "add_scan", broken)
        service.run_cycles(2)
    service.run_cycles(2)
    assert service.telemetry.state is State.DISARMED
    assert "IndexError" in service.ask("mission/state")["reason"]


@pytest.mark.timeout(60)
def test_a_ctrl_c_lost_in_a_kernel_ends_the_run(service: Service) -> None:
    """Numba's C code, which turns a kernel's result into an array, swallows exceptions."""
    came: list[int] = []

    def interrupt(frame: FrameType, event: str, _: object) -> None:
        if (event, frame.f_code.co_name) == ("call", "_numba_unpickle"):
            sys.setprofile(None)
            came.append(service.telemetry.time_us)
            signal.raise_signal(signal.SIGINT)

    service.put(GoTo(goals=(FAR,)))
    sys.setprofile(interrupt)
    service.robot.serve(speed=20.0)
    assert came
    assert service.mode == "idle"
    service.run_cycles(1)
    assert service.telemetry.state is State.DISARMED


@pytest.mark.parametrize(("loss", "confirmed"), [(0.0, True), (1.0, False)])
def test_serving_returns_whether_the_board_confirmed_the_stop(
    service: Service, loss: float, confirmed: bool
) -> None:
    def lose_bytes_and_interrupt() -> None:
        service.bench.fault("line.loss", loss)
        raise KeyboardInterrupt

    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    service.robot.after_cycle.append(lose_bytes_and_interrupt)
    assert service.robot.serve(speed=20.0) is confirmed


def test_commands_continue_while_telemetry_is_lost(service: Service) -> None:
    """The firmware stops after 300 ms without a command; the host waits 0.5 s for a frame."""
    inputs = service.robot.inputs
    inputs.read()
    begun_s = inputs.board.now_s()
    given_s = [begun_s]
    service.bench.fault("line.loss", 1.0)
    assert not inputs.read(lambda: given_s.append(inputs.board.now_s()))
    assert inputs.board.now_s() - begun_s == pytest.approx(0.5, abs=0.02)
    gaps_s = [after - before for before, after in pairwise(given_s)]
    assert len(gaps_s) == 2
    assert max(gaps_s) < 0.2
    service.bench.fault("line.loss", 0.0)
