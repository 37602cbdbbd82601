"""Manual driving stops before obstacles, unless the operator overrides it: the real firmware in a room."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.e2e.service import Service
from tests.variants import some_of
from thumper.common.geometry import Pose2, Twist2
from thumper.config.robot import RobotConfig, with_ports
from thumper.runtime.assembly import open_robot
from thumper.runtime.requests import OverrideAssistance, Request, RobotCommand, TeleopSource, Velocity
from thumper_hil.bench import simulation

CYCLES = 120
LEGS = """
description = "room with two chair legs"
[[wall]]
closed = true
points_m = [[-3, -3], [3, -3], [3, 3], [-3, 3]]
[[circle]]
x_m = -0.60
y_m = 0.0
radius_m = 0.02
[[circle]]
x_m = -0.18
y_m = 0.21
radius_m = 0.02
"""
AHEAD, BACK = Twist2(v_m_s=0.35), Twist2(v_m_s=-0.35)


def hold(service: Service, source: TeleopSource, twist: Twist2, cycles: int, *others: Request) -> float:
    """Hold a command; return how far the robot has come [m]."""
    start = service.bench.truth()[-1]
    for _ in range(cycles):
        service.put(Velocity(channel=source, twist=twist), *others)
    end = service.bench.truth()[-1]
    return math.hypot(end[1] - start[1], end[2] - start[2])


@pytest.mark.parametrize("source", some_of(TeleopSource))
@pytest.mark.parametrize(
    "twist", [AHEAD, pytest.param(Twist2(v_m_s=0.35, w_rad_s=0.4), marks=pytest.mark.slow)]
)
def test_a_held_command_does_not_touch_the_wall(
    service: Service, source: TeleopSource, twist: Twist2
) -> None:
    service.put(RobotCommand(name="arm"))
    assert hold(service, source, twist, CYCLES) > 0.4
    assert service.bench.contacts == 0


@pytest.mark.parametrize("twist", [Twist2(v_m_s=-0.25), Twist2(w_rad_s=-0.8)])
def test_a_held_command_does_not_touch_what_was_never_seen(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, twist: Twist2
) -> None:
    """One chair leg stands behind the robot, one beside its tail."""
    world = tmp_path / "legs.toml"
    world.write_text(LEGS)
    board, lidar = f"sim://unseen/board?world={world}", "sim://unseen/lidar"
    with open_robot(with_ports(RobotConfig(), board=board, lidar=lidar), Pose2()) as robot:
        service = Service(robot, simulation("unseen"))
        for part in ("service.request_handler", "service.request_queue", "drive.drive_manager"):
            clock = SimpleNamespace(monotonic=service.wall_s)
            monkeypatch.setattr(f"thumper.runtime.{part}.time", clock)
        service.run_cycles(8)
        service.put(RobotCommand(name="arm"))
        hold(service, TeleopSource.TELEOP, twist, 60)
        assert "never seen" in robot.drive_manager.reason
        assert service.bench.contacts == 0
        hold(service, TeleopSource.TELEOP, twist, 5, OverrideAssistance())
        assert robot.drive_manager.command == twist


def test_a_program_may_turn_at_once(service: Service) -> None:
    """A planner often begins with a turn, and judges unknown space itself."""
    service.put(RobotCommand(name="arm"))
    hold(service, TeleopSource.VELOCITY, Twist2(w_rad_s=0.8), 10)
    assert service.robot.drive_manager.command.w_rad_s > 0.5


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
