"""The judge of goals near walls: what a robot can reach in a room, by exact geometry."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper_hil.kinematic.reachable_poses import at_goal, reachable_poses
from thumper_hil.kinematic.world import KinematicWorld, box

ROOM_M = (-1.0, -0.6, 2.0, 1.2)
ROOM = KinematicWorld.from_boxes(box(0.0, 0.0, 2.0, 1.2))


def reached_at(goal: Goal) -> np.typing.NDArray[np.float64]:
    poses = reachable_poses(ROOM, Footprint(), Pose2(), ROOM_M)
    return poses[at_goal(poses, goal)]


@pytest.mark.slow
def test_beside_a_wall_only_the_headings_along_it_are_reached() -> None:
    """0.16 m from the wall a robot 0.30 m wide and 0.42 m long stands parallel to it."""
    headings_rad = reached_at(Goal(x_m=0.0, y_m=-0.44, tolerance_m=0.025))[:, 2]
    assert len(headings_rad) > 0
    assert np.abs(np.sin(headings_rad)).max() < 0.2


@pytest.mark.parametrize(
    ("goal", "possible"),
    [
        (Goal(x_m=0.0, y_m=-0.5, tolerance_m=0.1), True),
        (Goal(x_m=0.0, y_m=-0.5, tolerance_m=0.1, theta_rad=0.5 * math.pi), False),
        (Goal(x_m=0.0, y_m=-0.5, tolerance_m=0.1, theta_rad=math.pi), True),
        (Goal(x_m=0.0, y_m=-0.57, tolerance_m=0.1), False),
    ],
)
def test_goal_is_possible_only_if_the_outline_fits(goal: Goal, possible: bool) -> None:
    assert bool(len(reached_at(goal))) is possible
