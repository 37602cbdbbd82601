"""Wheels and gyroscope together: consistent, better than either, and aware of slip. All data simulated."""

import math

import numpy as np
import pytest

from thumper.geometry import Pose2, wrap_angle
from thumper.kinematics import DriveGeometry
from thumper.odometry.fused import FusedOdometry
from thumper.odometry.imu import ImuOptions, ImuSample
from thumper.odometry.odometry import Odometry, OdometryOptions, advance

GEOMETRY, WHEELS, IMU = DriveGeometry(counts_per_rev=1_200_000), OdometryOptions(), ImuOptions()
STEP_S, PER_STEP = 0.02, 2


class Drive:
    """A true drive, and what wheels and gyroscope say of it, by the noise that the options name."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.bias = float(self.rng.normal(0.0, IMU.bias_rad_s))
        self.pose, self.time_s = Pose2(), 0.0
        self._left_m = self._right_m = 0.0

    def step(self, v_m_s: float, w_rad_s: float, slip_rad: float = 0.0) -> list[ImuSample]:
        """Advance 20 ms; returns the gyroscope's readings."""
        arc_m, turn_rad = v_m_s * STEP_S, w_rad_s * STEP_S
        self.pose = advance(self.pose, arc_m, turn_rad)
        seen_m = arc_m + self.rng.normal(0.0, WHEELS.distance_noise * math.sqrt(abs(arc_m)))
        std_rad = math.sqrt(WHEELS.turn_noise**2 * abs(turn_rad) + WHEELS.drift_noise**2 * abs(arc_m))
        seen_rad = turn_rad + slip_rad + self.rng.normal(0.0, std_rad)
        self._left_m += seen_m - 0.5 * GEOMETRY.track_m * seen_rad
        self._right_m += seen_m + 0.5 * GEOMETRY.track_m * seen_rad
        std = IMU.noise_rad_s / math.sqrt(STEP_S / PER_STEP)
        samples = []
        for k in range(1, PER_STEP + 1):
            rate = w_rad_s + self.bias + self.rng.normal(0.0, std)
            samples.append(ImuSample(time_s=self.time_s + k * STEP_S / PER_STEP, yaw_rate_rad_s=rate))
        self.time_s += STEP_S
        self.bias += float(self.rng.normal(0.0, IMU.bias_walk_rad_s * math.sqrt(STEP_S)))
        return samples

    @property
    def counts(self) -> tuple[int, int]:
        per_count = GEOMETRY.rad_per_count * GEOMETRY.wheel_radius_m
        return round(self._left_m / per_count), round(self._right_m / per_count)


def driven(seed: int, seconds: float, *, slip: bool = False) -> tuple[Drive, FusedOdometry, Odometry]:
    """Stand 2 s, then drive curves; with `slip` the wheels spin on the spot once."""
    truth, fused, wheels = Drive(seed), FusedOdometry(GEOMETRY, WHEELS, IMU), Odometry(GEOMETRY, WHEELS)
    fused.update(0.0, 0, 0)
    wheels.update(0.0, 0, 0)
    for k in range(round(seconds / STEP_S)):
        moving = k * STEP_S > 2.0
        v, w = (0.4, 0.8 * math.sin(0.7 * k * STEP_S + seed)) if moving else (0.0, 0.0)
        for sample in truth.step(v, w, 0.06 if slip and 400 <= k < 430 else 0.0):
            fused.add_imu(sample)
        fused.update(truth.time_s, *truth.counts)
        wheels.update(truth.time_s, *truth.counts)
    return truth, fused, wheels


def test_the_covariance_says_how_large_the_errors_are() -> None:
    """Normalised squared errors of 40 drives: their mean is 4 for four states, within 3 standard errors."""
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


def test_the_heading_is_better_than_the_wheels_and_the_bias_is_found() -> None:
    errors = []
    for seed in range(12):
        truth, fused, wheels = driven(seed, 20.0)
        poses = [o.update(truth.time_s, *truth.counts).odom_from_base for o in (fused, wheels)]
        errors.append([wrap_angle(pose.theta_rad - truth.pose.theta_rad) for pose in poses])
        assert abs(fused.bias_rad_s - truth.bias) < 0.01
        assert fused.slips == 0
    fused_rad, wheels_rad = np.sqrt(np.mean(np.square(errors), axis=0))
    assert fused_rad < 0.6 * wheels_rad


def test_spinning_wheels_are_counted_and_do_not_turn_the_pose() -> None:
    truth, fused, wheels = driven(3, 12.0, slip=True)
    assert fused.slips == 1
    fused_pose = fused.update(truth.time_s, *truth.counts).odom_from_base
    wheels_pose = wheels.update(truth.time_s, *truth.counts).odom_from_base
    assert abs(wrap_angle(fused_pose.theta_rad - truth.pose.theta_rad)) < 0.1
    assert abs(wrap_angle(wheels_pose.theta_rad - truth.pose.theta_rad)) > 1.5


def test_without_a_gyroscope_it_is_the_wheels() -> None:
    fused, wheels = FusedOdometry(GEOMETRY), Odometry(GEOMETRY)
    for k in range(50):
        one, two = (o.update(0.02 * k, 900 * k, 1000 * k) for o in (fused, wheels))
        assert one.odom_from_base == two.odom_from_base
        assert one.twist == two.twist
        np.testing.assert_allclose(one.covariance, two.covariance, atol=1e-12)


@pytest.mark.parametrize("rate", [math.nan, math.inf])
def test_readings_that_are_no_numbers_or_out_of_order_are_left_out(rate: float) -> None:
    fused = FusedOdometry(GEOMETRY)
    fused.update(0.0, 0, 0)
    fused.add_imu(ImuSample(time_s=0.01, yaw_rate_rad_s=rate))
    fused.add_imu(ImuSample(time_s=0.02, yaw_rate_rad_s=0.0))
    fused.add_imu(ImuSample(time_s=0.01, yaw_rate_rad_s=50.0))
    sample = fused.update(0.02, 1000, 1000)
    assert abs(sample.odom_from_base.theta_rad) < 1e-9
