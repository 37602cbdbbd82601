"""A running robot explores on request, and stops on request: the real firmware in a room."""

import pytest

from tests.e2e.service import FAR, Service
from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.runtime.drive.exploration import NOTHING_LEFT
from thumper.runtime.drive.legs import Wait
from thumper.runtime.drive.tasks import Task, wait
from thumper.runtime.requests import GoTo, RobotCommand, TeleopSource, Velocity


def explored(service: Service) -> bool:
    return any("explored after" in event for event in service.events)


def test_explores_and_comes_back(service: Service) -> None:
    start = service.bench.truth()[-1]
    answer = service.ask("command", {"command": "explore"})
    assert "then back to" in answer["text"]
    service.until(lambda: service.status is not None and service.status.reason == "exploring: frontier 1")
    service.until(
        lambda: any(event.endswith("back at the start") for event in service.events), max_cycles=1500
    )
    assert explored(service), service.events
    assert service.robot.drive_manager.reason == service.events[-1]
    assert "m² of free floor; back" in service.events[-1]
    end = service.bench.truth()[-1]
    assert abs(end[1] - start[1]) < 0.25
    assert abs(end[2] - start[2]) < 0.25
    assert service.bench.contacts == 0
    service.run_cycles(30)
    for _ in range(2):  # on the way back it may have seen a corner more
        if not service.robot.drive_manager.reason.startswith(NOTHING_LEFT):
            service.ask("command", {"command": "explore"})
            service.run_cycles(30)
            ends = "m² of free floor", "at the start"
            service.until(lambda: service.robot.drive_manager.reason.endswith(ends))  # noqa: B023
    assert service.robot.drive_manager.reason.startswith(NOTHING_LEFT)


def test_an_exploration_ends_the_mission_before_it(service: Service) -> None:
    service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})
    service.put(RobotCommand(name="explore"))
    assert service.ask("mission/state")["state"] == "failed"


def test_a_cancelled_exploration_stays_cancelled(service: Service) -> None:
    service.put(RobotCommand(name="explore"))
    service.run_cycles(20)
    service.put(RobotCommand(name="cancel"))
    service.run_cycles(60)
    assert service.mode == "idle"
    assert any("not back" in event for event in service.events), service.events


def test_a_robot_at_rest_between_two_frontiers_is_cancelled_too(service: Service) -> None:
    results = []

    def choose() -> Task:
        result = yield Wait(duration_s=30.0, name="choosing a frontier")
        results.append(result)
        return result

    service.robot.drive_manager.reason = "at the goal (1.00, 0.00)"
    service.robot._tasks.begin_at_once(choose())
    service.run_cycles(5)
    assert service.robot.drive_manager.reason == "choosing a frontier"  # it is not at a goal of the user
    service.put(RobotCommand(name="cancel"))
    service.run_cycles(2)
    assert [(result.interrupted, result.reason) for result in results] == [(True, "cancelled")]


def test_after_a_wait_the_robot_reports_what_it_did_before(service: Service) -> None:
    service.robot.drive_manager.reason = "at the goal (1.00, 0.00)"
    service.robot._tasks.begin_at_once(wait(0.3))
    service.run_cycles(8)
    assert service.robot.drive_manager.reason == "at the goal (1.00, 0.00)"


def test_manual_driving_and_goals_end_the_exploration(service: Service) -> None:
    for request in (Velocity(channel=TeleopSource.TELEOP, twist=Twist2(w_rad_s=0.5)), GoTo(goals=(FAR,))):
        service.put(RobotCommand(name="explore"))
        service.run_cycles(15)
        service.put(request)
        service.run_cycles(5)
        task = service.robot._tasks.task
        assert task is None or task.leg is None or task.leg.name == "driving"
        service.put(RobotCommand(name="cancel"))
        service.run_cycles(30)
        assert service.mode == "idle"


def test_it_is_refused_while_the_robot_does_not_map(service: Service) -> None:
    service.put(RobotCommand(name="localize"))
    answer = service.ask("command", {"command": "explore"})
    assert not answer["ok"]
    assert "does not map" in answer["error"]
    with pytest.raises(ThumperError):
        service.robot.request_handler._commands.run("explore")
