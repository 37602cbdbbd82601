"""The collision monitor alone: points against motions with a closed form."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.speed_limits import SpeedLimits, stoppable_speed

LIMITS = SpeedLimits()
MONITOR = CollisionMonitor(CollisionMonitorOptions(), LIMITS, Footprint())
FRONT_M, SIDE_M, MARGIN_M = 0.21, 0.15, 0.02


def at(x_m: float, y_m: float) -> FloatArray:
    return np.array(((x_m, y_m),))


def stop_reason(command: Twist2, twist: Twist2, hits_m: FloatArray) -> str | None:
    return MONITOR.stop_reason(command, twist, hits_m, np.zeros(len(hits_m)), 0.1)


@pytest.mark.parametrize("v_m_s", [0.1, 0.25, 0.4])
def test_stops_exactly_if_the_stopping_distance_reaches_the_point(v_m_s: float) -> None:
    """Distance: latency and one period at full speed, then v^2 / 2a."""
    stopping_m = v_m_s * (LIMITS.latency_s + 0.1) + v_m_s**2 / (2.0 * LIMITS.v_accel_m_s2)
    edge_m = FRONT_M + MARGIN_M + stopping_m
    moving = Twist2(v_m_s=v_m_s)
    assert stop_reason(moving, moving, at(edge_m - 0.02, 0.0))
    assert not stop_reason(moving, moving, at(edge_m + 0.02, 0.0))
    assert not stop_reason(moving, moving, at(FRONT_M + MARGIN_M + 0.01, SIDE_M + MARGIN_M + 0.005))


def test_reason_names_the_place_of_the_obstacle() -> None:
    reason = stop_reason(Twist2(v_m_s=0.4), Twist2(), at(0.30, 0.05))
    assert reason is not None
    assert "0.30 m ahead, +0.05 m" in reason


def test_rotation_sweeps_the_corners() -> None:
    turning = Twist2(w_rad_s=1.0)
    corner_m = math.hypot(FRONT_M, SIDE_M)
    beside = at(0.0, corner_m - 0.01)
    fast = Twist2(w_rad_s=1.1)
    poses_needed_rad = math.pi / 2 - math.atan2(SIDE_M, FRONT_M)  # until the front left corner is abeam
    assert not stop_reason(turning, Twist2(), at(0.0, corner_m + 0.05))
    ahead_of_corner = corner_m * np.array(((math.cos(0.9), math.sin(0.9)),))
    assert poses_needed_rad > 0.9
    assert stop_reason(turning, turning, ahead_of_corner)
    assert not stop_reason(Twist2(w_rad_s=-0.3), Twist2(), ahead_of_corner)
    assert stop_reason(fast, fast, beside) is None  # stops before it gets that far round


def test_position_error_adds_to_the_margin() -> None:
    """Beside the rear, where a right turn swings the corner out: 3.5 cm are enough, or not."""
    turning, beside = Twist2(w_rad_s=-0.2), at(-0.19, SIDE_M + 0.035)
    assert not MONITOR.stop_reason(turning, Twist2(), beside, np.zeros(1), 0.1)
    assert MONITOR.stop_reason(turning, Twist2(), beside, np.array((0.02,)), 0.1)


def test_creeping_ends_at_half_the_margin_plus_the_position_error() -> None:
    """Many cycles, each from standstill; a point with an error of 2 cm stays 3 cm away."""
    for error_m in (0.0, 0.02):
        gap_m = MARGIN_M + error_m - 0.001
        for _ in range(100):
            point, error = at(FRONT_M + gap_m, 0.0), np.array((error_m,))
            if not MONITOR.stop_reason(Twist2(v_m_s=0.01), Twist2(), point, error, 0.1):
                gap_m -= 0.002
        assert gap_m == pytest.approx(error_m + 0.5 * MARGIN_M, abs=0.004)


def test_touching_robot_may_leave_but_not_press_on() -> None:
    touching = at(FRONT_M + 0.01, 0.0)
    assert not stop_reason(Twist2(v_m_s=-0.1), Twist2(), touching)
    assert not stop_reason(Twist2(), Twist2(), touching)
    assert stop_reason(Twist2(v_m_s=0.1), Twist2(), touching)


def test_no_hits_no_stop() -> None:
    assert stop_reason(Twist2(v_m_s=0.4), Twist2(v_m_s=0.4), np.empty((0, 2))) is None


@pytest.mark.parametrize("distance", [0.0, 0.05, 0.4, 3.0])
def test_stoppable_speed_solves_its_equation(distance: float) -> None:
    v = stoppable_speed(distance, 0.4, 0.2)
    assert v * 0.2 + v**2 / (2 * 0.4) == pytest.approx(distance)


def test_bend_that_straightens_early_is_checked() -> None:
    """In a fast left bend: a post that only a straight exit from the bend would reach."""
    bend = Twist2(v_m_s=0.45, w_rad_s=0.9)
    driven_s = LIMITS.latency_s + 0.1
    turned_rad = bend.w_rad_s * driven_s
    radius_m = bend.v_m_s / bend.w_rad_s
    begin_m = radius_m * np.array((math.sin(turned_rad), 1.0 - math.cos(turned_rad)))
    ahead = np.array((math.cos(turned_rad), math.sin(turned_rad)))
    right = np.array((ahead[1], -ahead[0]))
    post_m = begin_m + (FRONT_M + 0.15) * ahead + 0.9 * SIDE_M * right
    assert stop_reason(bend, bend, post_m[None, :])


def test_creeping_never_adds_up_to_a_contact() -> None:
    """Each cycle drives the motion that the monitor allows; the point is 20 mm ahead at first."""
    gap_m = 0.02
    for _ in range(500):
        moved_m = 0.0
        for step_m in (0.003, 0.001, 0.0003, 0.0001):
            slow = Twist2(v_m_s=step_m / (LIMITS.latency_s + 0.1))
            if not stop_reason(slow, Twist2(), at(FRONT_M + gap_m, 0.0)):
                moved_m = step_m
                break
        gap_m -= moved_m
    assert gap_m > 0.007


def test_noise_at_standstill_never_adds_up_to_a_contact() -> None:
    """Backs up whenever that is allowed, toward a post 20 mm behind, with a noisy measured twist."""
    rng, gap_m, slow = np.random.default_rng(0), 0.02, Twist2(v_m_s=-0.02)
    for _ in range(500):
        measured = Twist2(v_m_s=0.01 * rng.standard_normal(), w_rad_s=0.02 * rng.standard_normal())
        if not stop_reason(slow, measured, at(-FRONT_M - gap_m, 0.0)):
            gap_m -= 0.1 * abs(slow.v_m_s)
    assert gap_m > 0.007


@pytest.mark.parametrize(("gap_m", "part"), [(0.10, 0.4), (0.24, 0.6), (0.36, 0.9), (0.6, 1.0)])
def test_slow_zone_scales_both_speeds_by_the_time_to_contact(gap_m: float, part: float) -> None:
    slow = MONITOR.slow_down(Twist2(v_m_s=0.4), at(FRONT_M + gap_m, 0.0))
    assert slow.v_m_s == pytest.approx(part * 0.4, abs=0.06 * 0.4)
    bent = MONITOR.slow_down(Twist2(v_m_s=0.4, w_rad_s=0.2), at(FRONT_M + gap_m, 0.0))
    assert bent.w_rad_s == pytest.approx(0.5 * bent.v_m_s)
