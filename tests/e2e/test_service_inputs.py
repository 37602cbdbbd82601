"""A manually driven robot hits a wall: its bumper or its accelerometer stops it."""

import numpy as np

from tests.e2e.service import Service
from thumper.board.messages import Fault, State
from thumper.common.geometry import Twist2
from thumper.runtime.requests import OverrideAssistance, RobotCommand, TeleopSource, Velocity

BACK = Twist2(v_m_s=-0.3)
WHILE_LOW = 1
IMPACT_V = 0.8


def test_a_bumper_stops_the_robot_at_a_wall_and_tells_why(service: Service) -> None:
    assert service.ask("parameters/set", {"input_1": WHILE_LOW})["ok"]
    service.put(RobotCommand(name="arm"))
    while service.bench.contacts == 0:
        service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=BACK), OverrideAssistance())
        assert service.bench.time_s < 30.0
    touched_s = service.bench.time_s
    service.until(lambda: service.telemetry.state is State.FAULT, max_cycles=2)
    assert service.telemetry.fault is Fault.INPUT_1
    service.run_cycles(10)
    truth = service.bench.truth()
    assert np.abs(truth[truth[:, 0] > touched_s + 0.5, 4:6]).max() < 0.05
    assert any("input 1 is active (bumper" in event for event in service.events)
    # The bumper still touches the wall.
    refused = service.ask("command", {"command": "clear_fault"})
    assert "input is active" in refused["error"]


def test_the_accelerometer_notices_a_wall(service: Service) -> None:
    assert service.ask("parameters/set", {"impact_limit": IMPACT_V})["ok"]
    service.put(RobotCommand(name="arm"))
    while service.bench.contacts == 0:
        assert service.telemetry.fault is Fault.NONE
        service.put(Velocity(channel=TeleopSource.GAMEPAD, twist=BACK), OverrideAssistance())
        assert service.bench.time_s < 30.0
    service.until(lambda: service.telemetry.state is State.FAULT, max_cycles=2)
    assert service.telemetry.fault is Fault.IMPACT
    service.run_cycles(2)
    assert any("felt an impact" in event for event in service.events)
