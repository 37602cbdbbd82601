"""The DWA controller: simulation, admissible commands, scores."""

import math

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.dwa import DwaController, DwaOptions
from thumper.navigation.controllers.dwa_kernels import Dynamics, MotionStart, simulate
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits

LIMITS = SpeedLimits()
DYNAMICS = Dynamics(v_accel=LIMITS.v_accel_m_s2, w_accel=LIMITS.w_accel_rad_s2, latency_s=0.2, step_s=0.1)


def straight_path(angle_rad: float = 0.0, length_m: float = 2.0) -> FloatArray:
    along_m = np.arange(0.0, length_m, 0.05)
    return np.column_stack((along_m * math.cos(angle_rad), along_m * math.sin(angle_rad)))


def request(
    path_m: FloatArray,
    *,
    obstacles_m: FloatArray | None = None,
    last: Twist2 | None = None,
    v_limit_m_s: float = 0.4,
) -> ControlRequest:
    grid = OccupancyGrid(
        cells=np.zeros((120, 120), np.int8), resolution_m=0.05, origin_x_m=-3.0, origin_y_m=-3.0
    )
    hits_m = np.empty((0, 2)) if obstacles_m is None else obstacles_m
    return ControlRequest(
        map_from_base=Pose2(),
        twist=last or Twist2(),
        last_command=last or Twist2(),
        path_m=path_m,
        costmap=build_costmap(grid, hits_m, Footprint(), CostmapOptions()),
        v_limit_m_s=v_limit_m_s,
        period_s=0.1,
    )


def controller() -> DwaController:
    return DwaController(DwaOptions(), RotateInPlaceOptions(), LIMITS, Footprint())


def wall_m(x_m: float) -> FloatArray:
    y_m = np.arange(-2.0, 2.0, 0.02)
    return np.column_stack((np.full(y_m.size, x_m), y_m))


def test_simulated_arc_is_exact() -> None:
    """v / w is the radius; after w t = 1.2 rad the pose is (R sin, R (1 - cos), 1.2)."""
    poses = np.empty((12, 3))
    start = MotionStart(x=0.0, y=0.0, theta=0.0, v=0.4, w=1.0)
    simulate(start, np.array((0.4, 1.0)), DYNAMICS, poses)
    expected = (0.4 * math.sin(1.2), 0.4 * (1.0 - math.cos(1.2)), 1.2)
    assert poses[-1] == pytest.approx(expected, abs=1e-3)


def test_simulation_accelerates_after_the_latency() -> None:
    poses = np.empty((6, 3))
    start = MotionStart(x=0.0, y=0.0, theta=0.0, v=0.0, w=0.0)
    simulate(start, np.array((0.4, 0.0)), DYNAMICS, poses)
    assert np.diff(poses[:, 0], prepend=0.0) == pytest.approx((0, 0, 0.004, 0.008, 0.012, 0.016))


def test_accelerates_along_a_free_straight_path() -> None:
    result = controller().compute_command(request(straight_path(), last=Twist2(v_m_s=0.2)))
    assert result.command is not None
    assert result.command.v_m_s == pytest.approx(0.24)
    assert abs(result.command.w_rad_s) < 0.03
    assert result.trajectory.shape == (17, 3)


def test_keeps_the_speed_limit() -> None:
    result = controller().compute_command(request(straight_path(), last=Twist2(v_m_s=0.12), v_limit_m_s=0.1))
    assert result.command is not None
    assert result.command.v_m_s <= 0.1


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_turns_toward_a_path_to_the_side_while_driving(side: float) -> None:
    result = controller().compute_command(request(straight_path(0.5 * side), last=Twist2(v_m_s=0.2)))
    assert result.command is not None
    assert not result.rotating
    assert result.command.w_rad_s * side == pytest.approx(0.15)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_rotates_in_place_if_the_path_leads_back(side: float) -> None:
    result = controller().compute_command(request(straight_path(2.5 * side)))
    assert result.command is not None
    assert result.rotating
    assert result.command.v_m_s == 0.0
    assert result.command.w_rad_s * side > 0.0


def test_slows_down_before_a_wall_and_rejects_all_at_it() -> None:
    slowing = controller().compute_command(
        request(straight_path(), obstacles_m=wall_m(0.75), last=Twist2(v_m_s=0.4))
    )
    assert slowing.command is not None
    assert slowing.command.v_m_s < 0.4
    rejected = controller().compute_command(
        request(straight_path(), obstacles_m=wall_m(0.3), last=Twist2(v_m_s=0.4))
    )
    assert rejected.command is None
    assert rejected.reason == "no free motion: obstacles on all sides"


def test_rotation_is_rejected_only_if_a_post_is_in_its_way() -> None:
    """A post beside the front blocks half a turn in both directions: the rear hits it, too."""
    post = np.array(((0.16, 0.18),))
    blocked = controller().rotate(request(straight_path(), obstacles_m=post), math.pi)
    assert blocked.command is None
    assert "in either direction" in blocked.reason
    freely = controller().rotate(request(straight_path(), obstacles_m=post), -0.4)
    assert freely.command is not None
    assert freely.command.w_rad_s < 0.0


def test_window_stays_within_the_limits() -> None:
    fast = Twist2(v_m_s=0.39, w_rad_s=1.19)
    window = controller()._window(request(straight_path(), last=fast))
    assert window[:, 0].min() >= 0.0
    assert window[:, 0].max() <= LIMITS.v_max_m_s
    assert np.abs(window[:, 1]).max() <= LIMITS.w_max_rad_s
    assert np.abs(window[:, 0] - 0.39).max() <= 0.04 + 1e-12


def test_rejects_a_horizon_shorter_than_the_stopping_time() -> None:
    with pytest.raises(ThumperError, match=r"horizon_s = 0\.8 is too short .* use at least 1\.10"):
        DwaController(DwaOptions(horizon_s=0.8), RotateInPlaceOptions(), LIMITS, Footprint())


@pytest.mark.parametrize("left_m", [0.15, 0.3, 0.45])
def test_drives_to_the_end_of_the_path_as_fast_as_it_may(left_m: float) -> None:
    """The speed limit brakes in time; to reach the end only at the end of the rollout is to creep."""
    allowed = Twist2(v_m_s=0.3)
    at_end = request(straight_path(length_m=left_m), last=allowed, v_limit_m_s=0.3)
    command = controller().compute_command(at_end).command
    assert command is not None
    assert command.v_m_s == pytest.approx(0.3)
