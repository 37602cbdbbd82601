"""The way out of a refusal: past a post, away from it, not into the unknown behind; none where none is."""

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.safety.escape import Escape
from thumper.navigation.speed_limits import SpeedLimits

FOOTPRINT, LIMITS = Footprint(), SpeedLimits()
FRONT_M, SIDE_M = 0.21, 0.1225
MONITOR = CollisionMonitor(CollisionMonitorOptions(), LIMITS, FOOTPRINT)


def request(hits_m: FloatArray, *, known: bool = True) -> ControlRequest:
    """A robot that stands in the middle of a room, its path leading ahead and to the left."""
    cells = np.full((80, 80), 0 if known else -1, np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-2.0, origin_y_m=-2.0)
    return ControlRequest(
        map_from_base=Pose2(),
        twist=Twist2(),
        last_command=Twist2(),
        path_m=np.column_stack((np.linspace(0.0, 1.0, 21), np.linspace(0.0, 0.6, 21))),
        costmap=build_costmap(grid, hits_m, FOOTPRINT, CostmapOptions()),
        v_limit_m_s=0.4,
        period_s=0.1,
    )


def command(hits_m: FloatArray, *, known: bool = True) -> Twist2 | None:
    return Escape(MONITOR, LIMITS, FOOTPRINT).command(
        request(hits_m, known=known), hits_m, np.zeros(len(hits_m))
    )


def test_beside_a_post_it_turns_away_from_it_whatever_side_the_path_is_on() -> None:
    post_m = np.array(((0.08, SIDE_M + 0.008),))
    refused = Twist2(v_m_s=0.04, w_rad_s=0.15)  # along the path, which leads to the left
    assert MONITOR.objection(refused, Twist2(), post_m, np.zeros(1), 0.1)
    freeing = command(post_m, known=False)
    assert freeing is not None
    assert freeing.v_m_s >= 0.0
    assert freeing.w_rad_s < 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_post_at_the_tail_is_left_without_swinging_the_tail_at_it(side: float) -> None:
    freeing = command(np.array(((-0.2, side * (SIDE_M + 0.008)),)))
    assert freeing is not None
    assert freeing.v_m_s > 0.0
    assert freeing.w_rad_s * side >= 0.0


@pytest.mark.parametrize("known", [True, False])
def test_before_a_wall_it_backs_off_where_the_ground_behind_is_known(known: bool) -> None:
    wall_m = np.column_stack((np.full(41, FRONT_M + 0.01), np.linspace(-0.3, 0.3, 41)))
    freeing = command(wall_m, known=known)
    if known:
        assert freeing is not None
        assert freeing.v_m_s < 0.0
    else:
        assert freeing is None


def test_boxed_in_there_is_no_way_out() -> None:
    outline_m = FOOTPRINT.grown(0.004).outline_m(0.01)
    assert command(outline_m) is None
