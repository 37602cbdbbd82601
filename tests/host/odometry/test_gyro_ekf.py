"""Fusion of wheels and gyroscope: consistent, better than the wheels, detects slip. Simulated data."""

import math

import numpy as np
import pytest
from benchmarks.shared.gyro_drive import GEOMETRY, SLIP_FROM_S, driven

from tests.variants import some_of
from thumper.common.geometry import wrap_angle
from thumper.common.kinematics import DriveGeometry
from thumper.imu.sample import ImuSample
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.wheel_odometry import WheelOdometry


@pytest.mark.slow
def test_the_covariance_matches_the_errors() -> None:
    """The mean normalized squared error of 40 drives is 4 for four states, within 3 standard errors."""
    nees = []
    for seed in range(40):
        truth, fused, _ = driven(seed, 12.0)
        pose = fused.update(truth.time_s, *truth.counts).odom_from_base
        error = np.array(
            [
                pose.x_m - truth.pose.x_m,
                pose.y_m - truth.pose.y_m,
                wrap_angle(pose.theta_rad - truth.pose.theta_rad),
                fused.bias_rad_s - truth.bias,
            ]
        )
        nees.append(error @ np.linalg.solve(fused.covariance, error))
    assert np.mean(nees) == pytest.approx(4.0, abs=3.0 * math.sqrt(2.0 * 4.0 / 40))


def test_the_heading_beats_the_wheels_and_the_bias_converges() -> None:
    errors = []
    for seed in range(12):
        truth, fused, wheels = driven(seed, 20.0)
        poses = [o.update(truth.time_s, *truth.counts).odom_from_base for o in (fused, wheels)]
        errors.append([wrap_angle(pose.theta_rad - truth.pose.theta_rad) for pose in poses])
        assert abs(fused.bias_rad_s - truth.bias) < 0.01
        assert fused.slip.slips == 0
    fused_rad, wheels_rad = np.sqrt(np.mean(np.square(errors), axis=0))
    assert fused_rad < 0.6 * wheels_rad


def test_spinning_wheels_count_as_slip_and_do_not_turn_the_pose() -> None:
    truth, fused, wheels = driven(3, SLIP_FROM_S + 4.0, slip_rad_s=3.0)
    assert fused.slip.slips == 1
    fused_pose = fused.update(truth.time_s, *truth.counts).odom_from_base
    wheels_pose = wheels.update(truth.time_s, *truth.counts).odom_from_base
    assert abs(wrap_angle(fused_pose.theta_rad - truth.pose.theta_rad)) < 0.1
    assert abs(wrap_angle(wheels_pose.theta_rad - truth.pose.theta_rad)) > 1.5


@pytest.mark.slow
@pytest.mark.parametrize(("slip_rad_s", "slip_s"), some_of([(1.0, 0.3), (-1.0, 0.3), (0.5, 1.0)]))
def test_slow_slip_is_detected_over_many_steps(slip_rad_s: float, slip_s: float) -> None:
    """The error of one step is within its noise; that of ten steps in a row is not."""
    slips = [
        driven(seed, SLIP_FROM_S + 1.5, slip_rad_s=slip_rad_s, slip_s=slip_s)[1].slip.slips
        for seed in range(8)
    ]
    assert slips == [1] * 8


def test_without_a_gyroscope_it_equals_the_wheel_odometry() -> None:
    fused, wheels = GyroEkf(GEOMETRY), WheelOdometry(GEOMETRY)
    for k in range(50):
        one, two = (o.update(0.02 * k, 900 * k, 1000 * k) for o in (fused, wheels))
        assert one.odom_from_base == two.odom_from_base
        assert one.twist == two.twist
        np.testing.assert_allclose(one.covariance, two.covariance, atol=1e-12)


@pytest.mark.parametrize("rate", [math.nan, math.inf])
def test_invalid_or_late_samples_are_dropped(rate: float) -> None:
    fused = GyroEkf(GEOMETRY)
    fused.update(0.0, 0, 0)
    fused.add_imu(ImuSample(time_s=0.01, yaw_rate_rad_s=rate))
    fused.add_imu(ImuSample(time_s=0.02, yaw_rate_rad_s=0.0))
    fused.add_imu(ImuSample(time_s=0.01, yaw_rate_rad_s=50.0))
    sample = fused.update(0.02, 1000, 1000)
    assert abs(sample.odom_from_base.theta_rad) < 1e-9


@pytest.mark.parametrize("rate_Hz", [10.0, 40.0])
@pytest.mark.parametrize("swing_rad_s", [0.0, 0.1])
@pytest.mark.parametrize("bias_rad_s", some_of([-0.02, 0.0005, 0.01]))
def test_every_rest_teaches_the_bias(rate_Hz: float, swing_rad_s: float, bias_rad_s: float) -> None:
    """Also one far beyond the data sheet, with unequal wheels and a body that swings after each stop."""
    rng, geometry, dt_s = np.random.default_rng(1), DriveGeometry(), 1.0 / rate_Hz
    fused = GyroEkf(geometry)
    fused.update(0.0, 0, 0)
    left_m = right_m = time_s = 0.0

    def step(v_m_s: float, w_rad_s: float, swing_rad_s: float) -> None:
        nonlocal left_m, right_m, time_s
        time_s += dt_s
        left_m += (v_m_s - 0.6 * geometry.track_m * w_rad_s) * dt_s / 1.01
        right_m += (v_m_s + 0.6 * geometry.track_m * w_rad_s) * dt_s
        counts = (int(m / geometry.wheel_radius_m / geometry.rad_per_count) for m in (left_m, right_m))
        gyro_rad = (w_rad_s + swing_rad_s + bias_rad_s) * dt_s + rng.normal(0.0, 5e-4 * math.sqrt(dt_s))
        fused.update(time_s, *counts, gyro_rad=gyro_rad)

    for _ in range(6):
        for k in range(round(6.0 * rate_Hz)):
            step(0.3, 0.8 * math.sin(1.3 * k * dt_s), 0.0)
        for k in range(round(10.0 * rate_Hz)):
            step(0.0, 0.0, swing_rad_s * math.exp(-k * dt_s / 0.4))
    assert fused.bias_rad_s == pytest.approx(bias_rad_s, abs=0.001)
