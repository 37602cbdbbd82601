"""Poses compose and invert as rigid motions; kinematics match the thesis's (4.2), (4.10), (4.11)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.geometry import Pose2, Twist2
from thumper.common.kinematics import DriveGeometry, WheelSpeeds, body_twist, limit_wheel_speeds, wheel_speeds

lengths = st.floats(-50, 50)
angles = st.floats(-10, 10)
poses = st.builds(Pose2, x_m=lengths, y_m=lengths, theta_rad=angles)


def assert_same(a: Pose2, b: Pose2) -> None:
    assert (a.x_m, a.y_m) == pytest.approx((b.x_m, b.y_m), abs=1e-9)
    assert math.remainder(a.theta_rad - b.theta_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


@given(a=poses)
def test_a_pose_cancels_its_inverse(a: Pose2) -> None:
    assert_same(a @ a.inverse(), Pose2())
    assert_same(a.inverse() @ a, Pose2())


@given(a=poses, b=poses, c=poses)
def test_composition_is_associative(a: Pose2, b: Pose2, c: Pose2) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@given(a=poses, b=poses)
def test_points_transform_as_the_poses(a: Pose2, b: Pose2) -> None:
    in_c = np.array([[1.0, 2.0], [-3.0, 0.5]])
    np.testing.assert_allclose((a @ b).apply(in_c), a.apply(b.apply(in_c)), atol=1e-9)


def test_a_quarter_turn_is_counter_clockwise() -> None:
    turned = Pose2(theta_rad=math.pi / 2).apply(np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(turned, [[0.0, 1.0]], atol=1e-12)


@given(v=st.floats(-1, 1), w=st.floats(-3, 3), ratio=st.floats(0.8, 1.25))
def test_wheel_speeds_and_body_twist_are_inverses(v: float, w: float, ratio: float) -> None:
    geometry = DriveGeometry(radius_ratio=ratio)
    twist = body_twist(wheel_speeds(Twist2(v_m_s=v, w_rad_s=w), geometry), geometry)
    assert (twist.v_m_s, twist.w_rad_s) == pytest.approx((v, w), abs=1e-12)


def test_a_left_turn_drives_the_right_wheel_faster() -> None:
    speeds = wheel_speeds(Twist2(w_rad_s=1.0), DriveGeometry(wheel_radius_m=0.062, track_m=0.245))
    assert speeds.right_rad_s == pytest.approx(0.245 / (2 * 0.062))
    assert speeds.left_rad_s == pytest.approx(-speeds.right_rad_s)


@given(left=st.floats(-40, 40), right=st.floats(-40, 40))
def test_the_limit_keeps_the_curvature(left: float, right: float) -> None:
    limited = limit_wheel_speeds(WheelSpeeds(left_rad_s=left, right_rad_s=right), 13.0)
    assert max(abs(limited.left_rad_s), abs(limited.right_rad_s)) <= 13.0 + 1e-9
    assert limited.left_rad_s * right == pytest.approx(limited.right_rad_s * left, abs=1e-9)
