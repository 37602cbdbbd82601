"""What the robot remembers: it follows a jump of the map; of mixed pixels only the controllers know."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.costmap.local_model import LocalModel
from thumper.navigation.costmap.obstacle_memory import ObstacleMemoryOptions
from thumper.navigation.footprint import Footprint
from thumper.navigation.state import CycleInput

POST_IN_BASE = np.array(((-0.35, 0.10),))
NO_HITS = np.empty((0, 2))
AWAY = Pose2(theta_rad=math.pi)
GRID = OccupancyGrid(cells=np.zeros((160, 160), np.int8), resolution_m=0.05, origin_x_m=-4.0, origin_y_m=-4.0)


def cycle(time_s: float, base: Pose2, hits_m: FloatArray, map_from_odom: Pose2) -> CycleInput:
    return CycleInput(
        time_s=time_s,
        map_from_base=base,
        twist=Twist2(),
        grid=GRID,
        hits_in_map_m=hits_m,
        scan_pose=base,
        map_from_odom=map_from_odom,
        lost="",
        period_s=0.1,
    )


@pytest.mark.parametrize(
    ("correction", "steps", "driven_m", "follows"),
    [
        (Pose2(y_m=0.4), 1, 0.0, True),
        (Pose2(theta_rad=0.3), 1, 0.0, True),
        (Pose2(y_m=0.4), 5, 0.0, True),
        (Pose2(y_m=0.4), 20, 0.0, True),
        (Pose2(y_m=0.4), 5, 0.02, True),
        (Pose2(y_m=0.02), 1, 0.0, True),
        (Pose2(x_m=-0.9), 30, 0.03, False),
    ],
    ids=[
        "0.4 m",
        "0.3 rad",
        "5 steps of 8 cm",
        "20 steps of 2 cm",
        "5 steps of 8 cm, robot slow",
        "pose noise",
        "wheels that spin in place",
    ],
)
@pytest.mark.parametrize("idle_s", [0.1, 25.0])
def test_a_post_behind_the_robot_follows_a_jump_of_the_map(
    correction: Pose2, steps: int, driven_m: float, follows: bool, idle_s: float
) -> None:
    """The robot sees a post, turns its back to it, and then the map moves with the robot in it."""
    model = LocalModel(CostmapOptions(), ObstacleMemoryOptions(), Footprint(), Footprint(), FieldOfView())
    model.update(cycle(0.0, AWAY, POST_IN_BASE, Pose2()))
    model.update(cycle(0.1, Pose2(), np.empty((0, 2)), Pose2()))
    map_from_odom = odom_from_base = Pose2()
    for step in range(steps):
        part = (step + 1) / steps
        map_from_odom = Pose2(
            x_m=part * correction.x_m, y_m=part * correction.y_m, theta_rad=part * correction.theta_rad
        )
        odom_from_base = odom_from_base @ Pose2(x_m=driven_m)
        base = map_from_odom @ odom_from_base
        model.update(cycle(0.1 + idle_s + 0.1 * step, base, np.empty((0, 2)), map_from_odom))
    expected_m = (map_from_odom if follows else Pose2()).apply(POST_IN_BASE)
    kept_m = model.obstacles.points_m[: model.obstacles.seen]
    assert kept_m == pytest.approx(expected_m, abs=1e-6 if follows else 0.061)


def test_mixed_pixels_do_not_close_the_way_for_the_planner() -> None:
    """Behind a chair leg a point in the air, at another range in every scan; nothing returns from further."""
    model = LocalModel(CostmapOptions(), ObstacleMemoryOptions(), Footprint(), Footprint(), FieldOfView())
    leg_m = np.array(((1.0, 0.0), (1.0, 0.01)))
    rng = np.random.default_rng(1)
    for k in range(50):
        range_m = float(rng.uniform(1.2, 2.5))
        air_m = np.array(((range_m, 0.025 * range_m),))
        costmap = model.update(cycle(0.1 * k, Pose2(), np.vstack((leg_m, air_m)), Pose2()))
        assert model.obstacles.seen > len(leg_m)  # the collision monitor takes every point seriously
    assert costmap is not None
    rows, cols = costmap.cells_of(np.array(((1.0, 0.0), (1.8, 0.05))))
    assert (costmap.costs[rows, cols] == 254).tolist() == [True, False]
    assert costmap.costs[rows[1], cols[1]] < 253


def test_a_jump_between_two_goals_moves_the_local_frame() -> None:
    model = LocalModel(CostmapOptions(), ObstacleMemoryOptions(), Footprint(), Footprint(), FieldOfView())
    model.update(cycle(0.0, Pose2(), NO_HITS, Pose2()))
    model.observe(cycle(0.1, Pose2(y_m=0.4), NO_HITS, Pose2(y_m=0.4)))
    model.update(cycle(0.2, Pose2(y_m=0.4), NO_HITS, Pose2(y_m=0.4)))
    assert model.map_from_local.y_m == pytest.approx(0.4)


@pytest.mark.parametrize("lost", ["", "several places look alike"])
def test_a_lost_robot_has_seen_no_ground_by_its_map(lost: str) -> None:
    model = LocalModel(CostmapOptions(), ObstacleMemoryOptions(), Footprint(), Footprint(), FieldOfView())
    model.observe(replace(cycle(0.0, Pose2(), NO_HITS, Pose2()), lost=lost))
    assert (len(model.obstacles.points_m) > model.obstacles.seen) == bool(lost)


def test_who_walks_is_in_no_costmap_but_an_obstacle() -> None:
    model = LocalModel(CostmapOptions(), ObstacleMemoryOptions(), Footprint(), Footprint(), FieldOfView())
    walker_m = np.array(((1.0, 0.5), (1.01, 0.5), (1.02, 0.5)))
    for walks, answer in ((False, np.zeros), (True, np.ones)):
        vars(model)["are_walking"] = lambda points_m, answer=answer: answer(len(points_m), np.bool_)
        model.update(cycle(0.1 * walks, Pose2(), walker_m, Pose2()))
        assert len(model.obstacles.points_m) >= 3
        for costmap in (model.costmap, model.local_costmap):
            assert costmap is not None
            assert (costmap.costs[costmap.cells_of(walker_m)] == LETHAL).any() is not np.bool_(walks)
