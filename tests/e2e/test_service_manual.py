"""Manual driving of a running robot: after arming, before any goal, below the emergency stop."""

import math

import pytest

from tests.e2e.service import FAR, MANUAL_TIMEOUT_S, Service
from thumper.board.messages import Fault, State
from thumper.common.geometry import Twist2
from thumper.runtime.requests import (
    EmergencyStop,
    GoTo,
    OverrideAssistance,
    RobotCommand,
    TeleopSource,
    Velocity,
)

AHEAD = Twist2(v_m_s=0.3)


def test_manual_driving_needs_arming_and_follows_the_speed(service: Service) -> None:
    service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=AHEAD))
    assert service.mode == "idle"
    assert "arm the robot" in service.robot.drive_manager.reason
    service.put(RobotCommand(name="arm"))
    service.run_cycles(2)
    assert (service.mode, service.telemetry.state) == ("holding", State.CLOSED_LOOP)
    for _ in range(15):
        service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=AHEAD))
    assert (service.mode, service.telemetry.state) == ("manual", State.CLOSED_LOOP)
    assert service.bench.truth()[-1, 4] * 0.062 == pytest.approx(AHEAD.v_m_s, rel=0.1)


def test_release_or_silence_stops_manual_driving(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    for _ in range(10):
        service.put(Velocity(channel=TeleopSource.TELEOP, twist=AHEAD))
    service.put(Velocity(channel=TeleopSource.TELEOP, twist=Twist2()))
    service.run_cycles(2)
    assert (service.mode, service.telemetry.state) == ("holding", State.CLOSED_LOOP)
    for _ in range(10):
        service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=AHEAD))
    assert service.mode == "manual"
    service.waited_s += MANUAL_TIMEOUT_S
    service.run_cycles(1)
    assert service.mode == "holding"
    service.run_cycles(15)
    assert abs(service.bench.truth()[-1, 4]) < 0.05


def test_manual_driving_overrides_navigation(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=0.5)))
    service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=0.5)))
    assert service.mode == "manual"
    assert "overridden: driven by gamepad" in service.ask("mission/state")["reason"]
    service.waited_s += MANUAL_TIMEOUT_S
    service.run_cycles(20)
    assert service.mode == "holding"  # the drive does not resume


@pytest.mark.parametrize(
    "twist", [AHEAD, Twist2(w_rad_s=-1.2), Twist2(v_m_s=0.35, w_rad_s=0.6)], ids=["ahead", "turn", "arc"]
)
def test_a_manual_command_is_driven_at_its_speed(service: Service, twist: Twist2) -> None:
    service.put(RobotCommand(name="arm"))
    hold = (Velocity(channel=TeleopSource.TELEOP, twist=twist), OverrideAssistance())
    for _ in range(15):
        service.put(*hold)
    before = service.bench.truth()[-1]
    for _ in range(5):
        service.put(*hold)
    after = service.bench.truth()[-1]
    elapsed_s = after[0] - before[0]
    assert math.hypot(*(after[1:3] - before[1:3])) / elapsed_s == pytest.approx(
        twist.v_m_s, rel=0.1, abs=0.03
    )
    turned_rad = math.remainder(after[3] - before[3], math.tau)
    assert turned_rad / elapsed_s == pytest.approx(twist.w_rad_s, rel=0.2, abs=0.03)


@pytest.mark.parametrize(
    ("fault", "value", "trips"),
    [
        ("encoder.left.a", "cut", {Fault.STALL_LEFT}),
        ("motor.right", "dead", {Fault.STALL_RIGHT, Fault.REVERSED_RIGHT}),
        ("wheels.left", "blocked", {Fault.STALL_LEFT, Fault.OVER_CURRENT}),
    ],
)
def test_a_wheel_that_fails_stops_manual_driving(
    service: Service, fault: str, value: str, trips: set[Fault]
) -> None:
    service.put(RobotCommand(name="arm"))
    hold = (Velocity(channel=TeleopSource.TELEOP, twist=Twist2(w_rad_s=1.2)), OverrideAssistance())
    for _ in range(15):
        service.put(*hold)
    service.bench.fault(fault, value)
    failed_s = service.bench.time_s
    while service.telemetry.state is not State.FAULT:
        service.put(*hold)
        assert service.bench.time_s < failed_s + 1.5
    assert service.telemetry.fault in trips
    service.put(*hold)
    assert service.mode == "idle"
    assert (service.telemetry.left_pwm, service.telemetry.right_pwm) == (0, 0)


def test_an_emergency_stop_latches_until_cleared(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    service.put(EmergencyStop())
    service.run_cycles(1)
    assert service.telemetry.fault is Fault.E_STOP
    assert (service.telemetry.left_pwm, service.telemetry.right_pwm) == (0, 0)
    assert "latched" in service.ask("mission/send", {"x_m": 1.2, "y_m": 0.05})["error"]
    assert not service.ask("command", {"command": "arm"})["ok"]
    assert service.ask("command", {"command": "clear_fault"})["ok"]
    service.run_cycles(1)
    assert service.telemetry.state is State.DISARMED
    assert service.ask("mission/send", {"x_m": 1.2, "y_m": 0.05})["ok"]


def test_an_unconfirmed_emergency_stop_asks_to_cut_the_power(service: Service) -> None:
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    service.bench.fault("line.loss", 1.0)
    service.put(EmergencyStop())
    service.bench.fault("line.loss", 0.0)
    assert any("cut its power" in event for event in service.events)
    service.run_cycles(3)
    assert service.telemetry.state is State.FAULT
    assert (service.telemetry.left_pwm, service.telemetry.right_pwm) == (0, 0)


def test_velocity_of_another_program_is_controlled_and_the_keyboard_outranks_it(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    turn = Velocity(channel=TeleopSource.VELOCITY, twist=Twist2(w_rad_s=0.8))
    for _ in range(20):
        service.put(turn)
    state = service.robot.inputs.estimator.state()
    assert state is not None
    assert (service.mode, service.telemetry.state) == ("manual", State.CLOSED_LOOP)
    assert state.twist.w_rad_s == pytest.approx(0.8, abs=0.1)
    drive_manager = service.robot.drive_manager
    service.put(turn, Velocity(channel=TeleopSource.TELEOP, twist=AHEAD))
    assert drive_manager.reason.startswith("driven by teleop")
    service.put(Velocity(channel=TeleopSource.TELEOP, twist=Twist2()), turn)
    assert drive_manager.reason.startswith("driven by another program")
    service.waited_s += 0.31  # silent: it has expired
    service.run_cycles(10)
    assert (service.telemetry.left_setpoint, service.telemetry.right_setpoint) == (0, 0)
    assert service.telemetry.state is State.CLOSED_LOOP  # armed until disarm
