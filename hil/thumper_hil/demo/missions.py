"""The demo's missions, and the results of the thesis (Švec 2019, experiments 8.2 and 8.3)."""

import math
from dataclasses import dataclass

from thumper.common.geometry import Pose2

TOLERANCE_M = 0.4
THESIS_SPEED_ERROR_MEAN_RAD_S = -0.04
THESIS_SPEED_ERROR_STD_RAD_S = 0.31


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoMission:
    """One drive in one world; the world's frame is the map frame."""

    name: str
    title: str
    world: str
    start: Pose2
    goal_x_m: float
    goal_y_m: float


def _facing_goal(start: tuple[float, float], goal: tuple[float, float]) -> Pose2:
    heading_rad = math.atan2(goal[1] - start[1], goal[0] - start[0])
    return Pose2(x_m=start[0], y_m=start[1], theta_rad=heading_rad)


STRAIGHT = DemoMission(
    name="straight",
    title="straight run",
    world="lab",
    start=_facing_goal((1.73, 0.08), (-0.49, 0.02)),
    goal_x_m=-0.49,
    goal_y_m=0.02,
)
BOX = DemoMission(
    name="box",
    title="around a paper box",
    world="lab_box",
    start=_facing_goal((2.05, 0.64), (0.38, -0.45)),
    goal_x_m=0.38,
    goal_y_m=-0.45,
)
MISSIONS = (STRAIGHT, BOX)
