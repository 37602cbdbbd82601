"""A corridor that people block for good, in the kinematic simulator."""

import math

import numpy as np

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper_hil.kinematic.closed_loop import drive
from thumper_hil.kinematic.world import KinematicWorld, box

AREA = (-4.0, -4.0, 12.0, 8.0)
LEG_RADIUS_M = 0.06


def test_permanently_blocked_corridor_fails_with_a_reason() -> None:
    """Three people stand shoulder to shoulder in a corridor, on two legs each."""
    corridor = KinematicWorld.from_boxes(box(2.0, 0.0, 7.0, 1.4)).segments_m
    legs_m = [(2.5, y_m + side_m, LEG_RADIUS_M) for y_m in (-0.45, 0.0, 0.45) for side_m in (-0.1, 0.1)]
    world = KinematicWorld(segments_m=corridor, circles_m=np.array(legs_m))
    run = drive(world, Pose2(), Goal(x_m=4.5, y_m=0.0), AREA, limit_s=120.0)
    assert run.state is NavigationState.FAILED
    assert "no path" in run.reason
    assert run.clearance_m > 0.0
    assert math.dist((run.track[-1].x_m, run.track[-1].y_m), (0.0, 0.0)) < 2.3
