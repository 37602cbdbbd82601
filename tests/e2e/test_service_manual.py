"""A robot at service under a hand: armed first, before any goal, and never above the emergency stop."""

import pytest

from tests.e2e.service import FAR, HAND_TIMEOUT_S, Service
from thumper.board.messages import Fault, State
from thumper.common.geometry import Twist2
from thumper.runtime.requests import EmergencyStop, GoTo, RobotCommand, TeleopSource, Velocity

AHEAD = Twist2(v_m_s=0.3)


def test_a_hand_needs_arming_and_reaches_the_firmware_as_manual(service: Service) -> None:
    service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=AHEAD))
    assert service.mode == "idle"
    assert "arm the robot" in service.robot.drive_manager.reason
    service.put(RobotCommand(name="arm"))
    service.beats(2)
    assert (service.mode, service.telemetry.state) == ("holding", State.CLOSED_LOOP)
    for _ in range(15):
        service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=AHEAD))
    assert (service.mode, service.telemetry.state) == ("manual", State.MANUAL)
    assert service.bench.truth()[-1, 4] * 0.062 == pytest.approx(AHEAD.v_m_s, rel=0.2)


def test_letting_go_stops_it_and_so_does_a_pad_that_falls_silent(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    for _ in range(10):
        service.put(Velocity(channel=TeleopSource.TELEOP, twist=AHEAD))
    service.put(Velocity(channel=TeleopSource.TELEOP, twist=Twist2()))
    service.beats(2)
    assert (service.mode, service.telemetry.state) == ("holding", State.CLOSED_LOOP)
    for _ in range(10):
        service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=AHEAD))
    assert service.mode == "manual"
    service.waited_s += HAND_TIMEOUT_S
    service.beats(1)
    assert service.mode == "holding"
    service.beats(15)
    assert abs(service.bench.truth()[-1, 4]) < 0.05


def test_a_hand_overrides_navigation(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)
    service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=0.5)))
    service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=0.5)))
    assert service.telemetry.state is State.MANUAL
    assert "overridden: driven by gamepad" in service.ask("mission/state")["reason"]
    service.waited_s += HAND_TIMEOUT_S
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


def test_on_a_dead_line_the_person_is_told_to_cut_the_power(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.beats(10)
    service.bench.fault("line.loss", 1.0)
    service.put(EmergencyStop())
    service.bench.fault("line.loss", 0.0)
    assert any("cut its power" in event for event in service.events)
    service.beats(3)
    assert service.telemetry.state is State.FAULT
    assert (service.telemetry.left_pwm, service.telemetry.right_pwm) == (0, 0)
