"""Goals of a running robot: reached, replaced, cancelled, refused, guarded by heartbeats."""

import re

import pytest

from tests.e2e.service import FAR, MANUAL_TIMEOUT_S, NEAR, Service
from thumper.board.messages import Fault, State
from thumper.navigation.goal import Goal
from thumper.runtime.drive.display import NoDisplay
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.drive_result import DriveProgress
from thumper.runtime.requests import EmergencyStop, GoTo, Heartbeat, Request, RobotCommand


def test_a_disarmed_robot_maps(service: Service) -> None:
    assert service.mode == "idle"
    assert service.telemetry.state is State.DISARMED
    assert (service.robot.mapper.grid().cells >= 0).sum() > 500


def test_after_the_last_waypoint_the_motors_are_off(service: Service) -> None:
    service.put(GoTo(goals=(NEAR, Goal(x_m=0.9, y_m=0.05))))
    service.until(lambda: service.mode == "idle")
    assert abs(service.bench.truth()[-1, 1] - 0.9) < 0.15
    service.run_cycles(1)
    assert service.telemetry.state is State.DISARMED
    assert any(event.startswith("route of 2 goals reached after ") for event in service.events)
    assert service.ask("mission/state", {"mission": 1})["leg"] == 1


@pytest.mark.parametrize("before", [(), (FAR,)])
def test_the_end_of_a_goal_is_logged_once(service: Service, before: tuple[Goal, ...]) -> None:
    if before:
        service.put(GoTo(goals=before))
        service.run_cycles(15)
    service.put(GoTo(goals=(NEAR,)))
    service.until(lambda: service.mode == "idle")
    service.run_cycles(2)
    (event,) = [event for event in service.events if "reached" in event or "at the goal" in event]
    assert re.fullmatch(rf"goal {re.escape(str(NEAR))} m reached after \d+\.\d s", event)


def test_the_status_says_where_the_robot_drives(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(15)
    assert service.status is not None
    assert (service.status.mode, service.status.reason) == ("driving", f"to {FAR} m")
    service.put(GoTo(goals=(FAR, NEAR)))
    service.run_cycles(2)
    assert service.status.reason == "waypoint 1 of 2"


def test_a_refused_goal_leaves_the_mission_under_way(service: Service) -> None:
    first = service.ask("mission/send", {"x_m": NEAR.x_m, "y_m": NEAR.y_m})["mission"]
    service.run_cycles(15)
    assert not service.ask("mission/send", {"x_m": 900.0, "y_m": 0.0})["ok"]
    assert service.ask("mission/state")["state"] == "driving"
    service.until(lambda: service.mode == "idle")
    service.run_cycles(2)
    assert service.ask("mission/state", {"mission": first})["state"] == "reached"
    assert len([event for event in service.events if "reached after" in event]) == 1


def test_an_injected_fault_is_logged(service: Service) -> None:
    answer = service.ask("simulator/command", {"fault": "slip.left", "value": 0.5})
    service.run_cycles(2)
    assert answer["text"] in service.events


def test_a_new_goal_replaces_the_old_one_without_a_stop(service: Service) -> None:
    first = service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})["mission"]
    service.run_cycles(15)
    second = service.ask("mission/send", {"x_m": NEAR.x_m, "y_m": NEAR.y_m})["mission"]
    assert service.telemetry.state is State.CLOSED_LOOP
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state", {"mission": first})["state"] == "failed"
    assert service.ask("mission/state", {"mission": second})["state"] == "reached"


def test_cancel_stops_the_robot(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(15)
    assert service.bench.truth()[-1, 4] > 2.0
    assert service.ask("command", {"command": "cancel"})["text"] == "cancelled; the robot stops"
    service.until(lambda: service.mode == "idle")
    assert abs(service.bench.truth()[-1, 4]) < 0.05
    assert service.ask("mission/state")["reason"] == "cancelled"
    assert f"goal {FAR} m ended: cancelled" in service.events
    assert service.ask("command", {"command": "cancel"})["text"] == "the robot was not moving"
    service.ask("command", {"command": "arm"})
    text = service.ask("command", {"command": "cancel"})["text"]
    assert text == "the robot was not moving; the motors go off"


def test_an_emergency_stop_is_reported_by_name_and_is_no_failure(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(15)
    service.put(EmergencyStop())
    service.run_cycles(5)
    assert service.events[-3:] == [
        "navigating",
        f"goal {FAR} m ended: emergency stop",
        "the emergency stop was pressed",
    ]


def test_a_goal_in_a_wall_is_refused(service: Service) -> None:
    answer = service.ask("mission/send", {"x_m": 1.73 + 0.25, "y_m": 1.2})
    far = service.ask("mission/send", {"x_m": 900.0, "y_m": 0.0})
    assert not far["ok"]
    assert "choose a goal at most 50 m away" in far["error"]
    assert service.mode == ("driving" if answer["ok"] else "idle")


def test_a_client_whose_heartbeats_are_late_keeps_its_goal_and_its_exploration(service: Service) -> None:
    service.put(Heartbeat(source="page"), GoTo(goals=(FAR,)))
    for request in (None, RobotCommand(name="explore")):
        service.put(*([request] if request else []))
        service.run_cycles(5)
        service.waited_s += 10.0 * MANUAL_TIMEOUT_S
        service.run_cycles(5)
        assert service.mode == "driving"


def test_a_goal_that_queued_while_the_process_hung_is_rejected(service: Service) -> None:
    service.waited_s += 60.0
    service.put(GoTo(goals=(FAR,)), RobotCommand(name="arm"))
    assert service.mode == "idle"
    assert "hung" in service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})["error"]
    service.put(EmergencyStop())
    service.run_cycles(2)
    assert service.telemetry.fault is Fault.E_STOP
    service.put(RobotCommand(name="clear_fault"))
    service.waited_s += 1.5
    service.put(GoTo(goals=(FAR,)))
    assert service.mode == "driving"


@pytest.mark.parametrize(
    ("request_", "why"),
    [(RobotCommand(name="cancel"), "cancelled"), (EmergencyStop(), "emergency stop")],
    ids=["cancel", "emergency stop"],
)
def test_a_drive_to_its_own_goal_accepts_stops_but_no_goals(
    service: Service, request_: Request, why: str
) -> None:
    has_asked = False

    def ask(progress: DriveProgress) -> None:
        nonlocal has_asked
        if progress.time_s > 1.5 and not has_asked:
            has_asked = True
            service.robot.request_queue.put(GoTo(goals=(NEAR,)))
            service.robot.request_queue.put(request_)

    result = service.robot.run(drive_to_goal(FAR), NoDisplay(on_progress=ask))
    assert not result.reached
    assert result.interrupted  # a command with further legs must end
    assert result.reason == why
    assert any("its own goals" in event for event in service.events)
    assert abs(service.bench.truth()[-1, 4]) < 0.05
