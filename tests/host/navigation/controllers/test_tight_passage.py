"""The pose sequence follower alone: an ideal robot drives poses in open space and in a tight passage."""

import math

import numpy as np

from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower, TightPassageOptions
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.speed_limits import SpeedLimits

PERIOD_S = 0.1
MAX_CYCLES = 600


def track(grid: OccupancyGrid, start: Pose2, goal: Goal, *, passage_only: bool) -> list[Pose2]:
    """Return the poses of all cycles until the sequence ends."""
    footprint, limits = Footprint(), SpeedLimits()
    lattice = LatticePlanner(LatticeOptions(), TraversalCostOptions(), footprint)
    follower = PoseSequenceFollower(TightPassageOptions(length_m=5.0), limits, footprint, lattice)
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
    poses, twist = [start], Twist2()
    for cycle in range(MAX_CYCLES):
        request = ControlRequest(
            map_from_base=poses[-1],
            twist=twist,
            last_command=twist,
            path_m=np.array(((start.x_m, start.y_m), (goal.x_m, goal.y_m))),
            costmap=costmap,
            v_limit_m_s=limits.v_max_m_s,
            period_s=PERIOD_S,
        )
        if cycle == 0:
            follower.plan(request, goal, passage_only=passage_only)
            while (has_poses := follower.advance()) is None:
                pass
            assert has_poses
        result = follower.compute_command(request)
        if result is None:
            return poses
        assert result.command is not None, result.reason
        twist = result.command
        poses.append(
            poses[-1] @ Pose2(x_m=PERIOD_S * twist.v_m_s, theta_rad=PERIOD_S * twist.w_rad_s),
        )
    raise AssertionError("the sequence does not end")


def grid_of(cells: np.typing.NDArray[np.int8]) -> OccupancyGrid:
    return OccupancyGrid(cells=cells, resolution_m=0.025, origin_x_m=-1.0, origin_y_m=-1.0)


def test_rotation_over_several_poses_is_continuous() -> None:
    """The robot does not brake at each pose of 15 degrees."""
    back = Goal(x_m=-0.8, y_m=0.0)
    driven = track(grid_of(np.zeros((80, 120), np.int8)), Pose2(), back, passage_only=False)
    turned = next(i for i, pose in enumerate(driven) if abs(pose.theta_rad) > math.pi - 0.3)
    assert turned * PERIOD_S < 5.0
    assert back.distance_m(driven[-1]) < 0.15


def test_passage_only_sequence_ends_behind_the_passage() -> None:
    """A corridor 0.4 m wide until x = 1 m, then a hall, where the controller drives faster."""
    cells = np.zeros((80, 160), np.int8)
    cells[:32, :80] = cells[48:, :80] = 100
    start, goal = Pose2(x_m=0.3), Goal(x_m=2.5, y_m=0.0)
    assert 1.0 < track(grid_of(cells), start, goal, passage_only=True)[-1].x_m < 1.4
    assert track(grid_of(cells), start, goal, passage_only=False)[-1].x_m > 2.3
