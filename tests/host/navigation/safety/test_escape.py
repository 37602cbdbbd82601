"""Escape: past a post, away from it, not into unknown space behind; None if boxed in."""

from dataclasses import replace

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
FRONT_M, SIDE_M = 0.21, 0.15
MONITOR = CollisionMonitor(CollisionMonitorOptions(), LIMITS, FOOTPRINT)


def request(hits_m: FloatArray, *, known: bool = True) -> ControlRequest:
    """Return a request in the middle of a room, with a path ahead and to the left."""
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
    return Escape(MONITOR, LIMITS, FOOTPRINT).compute_command(
        request(hits_m, known=known), hits_m, np.zeros(len(hits_m))
    )


def test_turns_away_from_a_post_even_if_the_path_leads_toward_it() -> None:
    post_m = np.array(((0.08, SIDE_M + 0.008),))
    rejected = Twist2(v_m_s=0.04, w_rad_s=0.15)  # along the path, which leads to the left
    assert MONITOR.stop_reason(rejected, Twist2(), post_m, np.zeros(1), 0.1)
    escape = command(post_m, known=False)
    assert escape is not None
    assert escape.v_m_s >= 0.0
    assert escape.w_rad_s < 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_leaves_a_post_at_the_rear_without_swinging_toward_it(side: float) -> None:
    escape = command(np.array(((-0.2, side * (SIDE_M + 0.008)),)))
    assert escape is not None
    assert escape.v_m_s > 0.0
    assert escape.w_rad_s * side >= 0.0


@pytest.mark.parametrize("known", [True, False])
def test_backs_away_from_a_wall_only_over_known_space(known: bool) -> None:
    wall_m = np.column_stack((np.full(41, FRONT_M + 0.01), np.linspace(-0.3, 0.3, 41)))
    escape = command(wall_m, known=known)
    if known:
        assert escape is not None
        assert escape.v_m_s < 0.0
    else:
        assert escape is None


def test_drives_ahead_before_it_turns_round_beside_a_post() -> None:
    post_m = np.array(((-0.19, 0.23),))  # beside the rear: enough room to drive, not to turn
    back_m = np.column_stack((np.linspace(0.0, -1.0, 21), np.linspace(0.0, -0.6, 21)))
    asked = replace(request(post_m), path_m=back_m)
    escape = Escape(MONITOR, LIMITS, FOOTPRINT).compute_command(asked, post_m, np.zeros(1))
    assert escape is not None
    assert escape.v_m_s > 0.0


def test_boxed_in_robot_has_no_escape() -> None:
    outline_m = FOOTPRINT.grown(0.004).outline_m(0.01)
    assert command(outline_m) is None
