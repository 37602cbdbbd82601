"""A few worlds of the BARN challenge, scaled down until the gaps are hardly wider than the robot."""

import math
from pathlib import Path

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper_hil.kinematic.closed_loop import Conditions, drive
from thumper_hil.kinematic.world import KinematicWorld


@pytest.mark.parametrize(("index", "scale"), [(60, 1.0), (0, 0.65), (240, 0.65), (165, 0.65), (60, 0.5)])
def test_crosses_the_field_without_contact(nav_data: Path, index: int, scale: float) -> None:
    """Start, goal and success as the challenge has them, all lengths scaled; nothing is known at first."""
    centres = np.loadtxt(nav_data / "barn" / f"world_{index:03d}_cylinders.csv", delimiter=",", skiprows=1)
    world = KinematicWorld(circles_m=np.column_stack((centres[:, :2], np.full(len(centres), 0.075))) * scale)
    goal = Goal(x_m=-2.25 * scale, y_m=13.0 * scale)
    run = drive(
        world,
        Pose2(x_m=-2.25 * scale, y_m=3.0 * scale, theta_rad=0.5 * math.pi),
        goal,
        (-6.5 * scale, -scale, 8.5 * scale, 16.0 * scale),
        conditions=Conditions(pose_noise_m=0.0, pose_noise_rad=0.0, slip=0.0),
        limit_s=100.0,
        stop_when=lambda pose: goal.distance_m(pose) < scale,
    )
    assert run.goal_error_m < scale, run.reason
    assert run.clearance_m > 0.0
