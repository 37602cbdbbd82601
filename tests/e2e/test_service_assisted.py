"""Manual driving stops before obstacles, unless the operator overrides it: the real firmware in a room."""

import math

import pytest

from tests.e2e.service import Service
from thumper.common.geometry import Twist2
from thumper.runtime.requests import OverrideAssistance, Request, RobotCommand, TeleopSource, Velocity

CYCLES = 120
AHEAD, BACK = Twist2(v_m_s=0.35), Twist2(v_m_s=-0.35)


def hold(service: Service, source: TeleopSource, twist: Twist2, cycles: int, *others: Request) -> float:
    """Hold a command; return how far the robot has come [m]."""
    start = service.bench.truth()[-1]
    for _ in range(cycles):
        service.put(Velocity(channel=source, twist=twist), *others)
    end = service.bench.truth()[-1]
    return math.hypot(end[1] - start[1], end[2] - start[2])


@pytest.mark.parametrize("source", list(TeleopSource))
@pytest.mark.parametrize("twist", [AHEAD, Twist2(v_m_s=0.35, w_rad_s=0.4)])
def test_a_held_command_does_not_touch_the_wall(
    service: Service, source: TeleopSource, twist: Twist2
) -> None:
    service.put(RobotCommand(name="arm"))
    assert hold(service, source, twist, CYCLES) > 0.4
    assert service.bench.contacts == 0


def test_a_robot_does_not_back_into_a_wall_that_it_has_mapped(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    hold(service, TeleopSource.VELOCITY, Twist2(w_rad_s=1.0), 32)
    assert hold(service, TeleopSource.TELEOP, BACK, CYCLES) > 0.4
    assert "stopped before an obstacle" in service.robot.drive_manager.reason
    assert service.bench.contacts == 0


def test_a_robot_at_a_wall_turns_and_drives_away(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    hold(service, TeleopSource.TELEOP, AHEAD, CYCLES)
    assert hold(service, TeleopSource.TELEOP, BACK, 20) > 0.3
    assert service.bench.contacts == 0


def test_the_operator_can_override_it_while_the_button_is_held(service: Service) -> None:
    service.put(RobotCommand(name="arm"))
    hold(service, TeleopSource.GAMEPAD, AHEAD, CYCLES, OverrideAssistance())
    assert service.bench.contacts > 0
    hold(service, TeleopSource.GAMEPAD, BACK, 15, OverrideAssistance())
    service.waited_s += 0.31
    before = service.bench.contacts
    hold(service, TeleopSource.GAMEPAD, AHEAD, CYCLES)
    assert service.bench.contacts == before, "the override has expired"
