"""The pose buffer interpolates, extrapolates and clamps."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.geometry import Pose2, Twist2
from thumper.odometry.pose_buffer import PoseBuffer, interpolate, interpolate_poses
from thumper.odometry.wheel_odometry import OdometrySample, advance

V_M_S, W_RAD_S = 0.8, 1.2


def sample(time_s: float) -> OdometrySample:
    """A robot that has driven one circle since time 0."""
    return OdometrySample(
        time_s=time_s,
        odom_from_base=advance(Pose2(), V_M_S * time_s, W_RAD_S * time_s),
        twist=Twist2(v_m_s=V_M_S, w_rad_s=W_RAD_S),
        covariance=np.zeros((3, 3)),
    )


def full_buffer() -> PoseBuffer:
    buffer = PoseBuffer(horizon_s=1.0, extrapolation_s=0.2)
    for index in range(31):
        buffer.add(sample(0.1 * index))
    return buffer


def assert_same(pose: Pose2, expected: Pose2) -> None:
    assert pose.distance_m(expected) < 1e-9
    assert math.remainder(pose.theta_rad - expected.theta_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


@given(time_s=st.floats(2.0, 3.2))
def test_interpolation_on_a_circle_is_exact(time_s: float) -> None:
    assert_same(full_buffer().at(time_s), sample(time_s).odom_from_base)


def test_times_outside_the_buffer_are_clamped() -> None:
    buffer = full_buffer()
    assert_same(buffer.at(0.5), sample(2.0).odom_from_base)
    assert_same(buffer.at(9.0), sample(3.2).odom_from_base)
    assert [buffer.covers(t) for t in (0.5, 2.5, 3.1, 3.3)] == [False, True, True, False]


def test_a_late_sample_is_dropped() -> None:
    buffer = full_buffer()
    buffer.add(sample(2.55))
    assert_same(buffer.at(3.0), sample(3.0).odom_from_base)


def test_an_empty_buffer_raises() -> None:
    with pytest.raises(ValueError, match="empty"):
        PoseBuffer().at(0.0)


@given(
    x=st.floats(-2, 2),
    y=st.floats(-2, 2),
    theta=st.floats(-3, 3),
    part=st.floats(0, 1),
    part_of_part=st.floats(0, 1),
)
def test_interpolations_nest(x: float, y: float, theta: float, part: float, part_of_part: float) -> None:
    """A fraction of a fraction of a constant-twist motion is a fraction of the whole, with sideways slip."""
    start, end = Pose2(x_m=1.0, y_m=-2.0, theta_rad=0.3), Pose2(x_m=x, y_m=y, theta_rad=0.3 + theta)
    middle = interpolate(start, end, part)
    assert_same(interpolate(start, middle, part_of_part), interpolate(start, end, part * part_of_part))
    assert_same(interpolate(start, end, 1.0), end)


def test_interpolate_poses_is_linear_clamped_and_unwraps_the_heading() -> None:
    known = np.array([(0.0, 0.0, 3.0), (1.0, 2.0, -3.0)])
    found = interpolate_poses(np.array([-1.0, 0.5, 2.0]), np.array([0.0, 1.0]), known)
    assert found[:, :2].tolist() == [[0.0, 0.0], [0.5, 1.0], [1.0, 2.0]]
    assert found[1, 2] == pytest.approx(math.pi)
