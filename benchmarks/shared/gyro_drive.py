"""Simulated drives with the wheel and gyroscope noise of the options."""

import math

import numpy as np

from thumper.common.geometry import Pose2
from thumper.common.kinematics import DriveGeometry
from thumper.imu.options import ImuOptions
from thumper.imu.sample import ImuSample
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.wheel_odometry import OdometryOptions, WheelOdometry, advance

GEOMETRY, WHEELS = DriveGeometry(counts_per_rev=1_200_000), OdometryOptions()
IMU = ImuOptions(noise_rad_s=0.005, bias_rad_s=0.05, bias_walk_rad_s=0.0005)  # a cheap MEMS chip
STEP_S, PER_STEP = 0.02, 2
SLIP_FROM_S = 20.0  # by then the filter knows the noise of the wheels


class Drive:
    """A true drive, and its noisy wheel and gyroscope readings."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.bias = float(self.rng.normal(0.0, IMU.bias_rad_s))
        self.pose, self.time_s = Pose2(), 0.0
        self._left_m = self._right_m = 0.0

    def step(self, v_m_s: float, w_rad_s: float, slip_rad: float = 0.0) -> list[ImuSample]:
        """Advance 20 ms; return the gyroscope's samples."""
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


def driven(
    seed: int, seconds: float, *, slip_rad_s: float = 0.0, slip_s: float = 0.6
) -> tuple[Drive, GyroEkf, WheelOdometry]:
    """Stay stationary for 2 s, then drive curves. From 20 s the wheels spin and report a false rotation."""
    truth, fused, wheels = Drive(seed), GyroEkf(GEOMETRY, WHEELS, IMU), WheelOdometry(GEOMETRY, WHEELS)
    fused.update(0.0, 0, 0)
    wheels.update(0.0, 0, 0)
    for k in range(round(seconds / STEP_S)):
        time_s = k * STEP_S
        v, w = (0.4, 0.8 * math.sin(0.7 * time_s + seed)) if time_s > 2.0 else (0.0, 0.0)
        slips = SLIP_FROM_S <= time_s + 1e-9 < SLIP_FROM_S + slip_s
        for sample in truth.step(v, w, slip_rad_s * STEP_S if slips else 0.0):
            fused.add_imu(sample)
        fused.update(truth.time_s, *truth.counts)
        wheels.update(truth.time_s, *truth.counts)
    return truth, fused, wheels
