"""Wheel odometry against closed forms, and its invariants."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.kinematics import DriveGeometry
from thumper.odometry.wheel_odometry import WheelOdometry, count_delta

GEOMETRY = DriveGeometry(wheel_radius_m=0.1, track_m=0.2, counts_per_rev=1000)
M_PER_COUNT = GEOMETRY.rad_per_count * GEOMETRY.wheel_radius_m
COUNTS_PER_M = 1.0 / M_PER_COUNT


def wrapped(count: int) -> int:
    return (count + 2**31) % 2**32 - 2**31


@pytest.mark.parametrize("steps", [1, 10, 100])
def test_arc_is_exact_for_any_step_count(steps: int) -> None:
    """Closed form: radius R and turn phi end at (R sin phi, R (1 - cos phi), phi)."""
    odometry = WheelOdometry(GEOMETRY)
    odometry.update(0.0, 0, 0)
    left, right = 400, 600
    for step in range(1, steps + 1):
        sample = odometry.update(0.1 * step, step * left // steps, step * right // steps)
    turn_rad = (right - left) * M_PER_COUNT / GEOMETRY.track_m
    radius_m = 0.5 * (left + right) * M_PER_COUNT / turn_rad
    pose = sample.odom_from_base
    expected = (radius_m * math.sin(turn_rad), radius_m * (1.0 - math.cos(turn_rad)), turn_rad)
    assert (pose.x_m, pose.y_m, pose.theta_rad) == pytest.approx(expected, abs=1e-12)


def test_the_first_sample_is_the_origin_for_any_counts() -> None:
    sample = WheelOdometry(GEOMETRY).update(212.0, 29_221, -77)
    pose = sample.odom_from_base
    assert (pose.x_m, pose.y_m, pose.theta_rad) == (0.0, 0.0, 0.0)
    assert (sample.twist.v_m_s, sample.twist.w_rad_s) == (0.0, 0.0)
    assert not sample.covariance.any()


def test_twist_is_the_mean_speed() -> None:
    odometry = WheelOdometry(GEOMETRY)
    odometry.update(5.0, 0, 0)
    twist = odometry.update(5.1, round(0.1 * COUNTS_PER_M), round(0.2 * COUNTS_PER_M)).twist
    assert twist.v_m_s == pytest.approx(1.5, rel=0.01)
    assert twist.w_rad_s == pytest.approx(5.0, rel=0.01)


def test_a_repeated_stamp_moves_the_pose_and_keeps_the_twist() -> None:
    odometry = WheelOdometry(GEOMETRY)
    odometry.update(0.0, 0, 0)
    before = odometry.update(0.1, 100, 100)
    after = odometry.update(0.1, 300, 300)
    assert after.odom_from_base.x_m == pytest.approx(3.0 * before.odom_from_base.x_m)
    assert after.twist == before.twist


@given(start=st.integers(-(2**31), 2**31 - 1), step=st.integers(-(2**31), 2**31 - 1))
def test_delta_survives_the_wrap(start: int, step: int) -> None:
    assert count_delta(start, wrapped(start + step)) == step


@given(
    starts=st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1)),
    steps=st.lists(st.tuples(st.integers(-500, 500), st.integers(-500, 500)), min_size=1, max_size=30),
)
def test_the_path_does_not_depend_on_the_first_counts(
    starts: tuple[int, int], steps: list[tuple[int, int]]
) -> None:
    near_zero, anywhere = WheelOdometry(GEOMETRY), WheelOdometry(GEOMETRY)
    left, right = 0, 0
    near_zero.update(0.0, 0, 0)
    anywhere.update(0.0, *starts)
    for index, (left_step, right_step) in enumerate(steps, start=1):
        left, right = left + left_step, right + right_step
        expected = near_zero.update(0.1 * index, left, right)
        sample = anywhere.update(0.1 * index, wrapped(starts[0] + left), wrapped(starts[1] + right))
    assert sample.odom_from_base == expected.odom_from_base
    eigenvalues = np.linalg.eigvalsh(sample.covariance)
    assert (eigenvalues >= -1e-12).all()  # the covariance stays positive semidefinite


def test_the_covariance_of_a_straight_metre_has_the_closed_form() -> None:
    """The lateral std integrates a random walk of the heading: drift * 1 m / sqrt(3)."""
    odometry = WheelOdometry(GEOMETRY)
    odometry.update(0.0, 0, 0)
    for step in range(1, 101):
        count = round(0.01 * step * COUNTS_PER_M)
        sample = odometry.update(0.1 * step, count, count)
    std = np.sqrt(np.diag(sample.covariance))
    assert std == pytest.approx([0.02, 0.02 / math.sqrt(3.0), 0.02], rel=0.02)


def test_unequal_wheels_turn_a_robot_with_equal_counts() -> None:
    geometry = DriveGeometry(wheel_radius_m=0.06, radius_ratio=0.99, track_m=0.4, counts_per_rev=1000)
    odometry = WheelOdometry(geometry)
    odometry.update(0.0, 0, 0)
    pose = odometry.update(1.0, 1000, 1000).odom_from_base
    left_m, right_m = math.tau * geometry.left_radius_m, math.tau * geometry.right_radius_m
    assert geometry.left_radius_m == pytest.approx(0.99 * geometry.right_radius_m)
    assert pose.theta_rad == pytest.approx((right_m - left_m) / 0.4)
    assert math.hypot(pose.x_m, pose.y_m) == pytest.approx(math.tau * 0.06, rel=1e-3)
