"""A host that computes too slowly for its robot: the drive ends with the motors off, and says why."""

import re
from dataclasses import replace
from unittest.mock import patch

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench import simulation
from thumper_hil.effects.preset import load_preset

NOMINAL = load_preset("nominal")


def drive(name: str, cpu_factor: float) -> tuple[bool, str]:
    """Return whether the robot reached a goal 1 m ahead, and why not; it must be stationary and untouched."""
    preset = replace(NOMINAL, host=replace(NOMINAL.host, cpu_factor=cpu_factor))
    board = f"sim://{name}/board?world=hall"
    with (
        patch("thumper_hil.bench.bench.load_preset", lambda _name: preset),
        open_robot(with_ports(RobotConfig(), board=board, lidar=f"sim://{name}/lidar"), Pose2()) as robot,
    ):
        try:
            result = robot.run(drive_to_goal(Goal(x_m=1.0, y_m=0.0)))
            reached, reason = result.reached, result.reason
        except ThumperError as refusal:
            reached, reason = False, str(refusal)
        bench = simulation(name)
        bench.advance(bench.time_s + 1.0)
        speeds = bench.truth()[-10:, 4:]
    assert abs(speeds).max() < 0.05
    assert bench.contacts == 0
    return reached, reason


def test_a_host_that_is_fast_enough_drives() -> None:
    assert drive("fast", 1.0)[0]


@pytest.mark.parametrize("cpu_factor", [150.0, pytest.param(250.0, marks=pytest.mark.slow)])
def test_a_host_that_is_too_slow_stops_and_says_why(cpu_factor: float) -> None:
    reached, reason = drive(f"slow-{cpu_factor:.0f}", cpu_factor)
    assert not reached
    assert re.search("computer (is )?overloaded", reason), reason
