"""Fuse recorded wheels and gyroscope of a skid-steered robot, whose wheels turn it 2.4 times too far."""

import pytest
from benchmarks.gyroscope import DATA, GEOMETRIC, IMU, effective, load, numbers, rms_rad

from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.wheel_odometry import WheelOdometry

pytestmark = pytest.mark.skipif(not numbers(), reason=f"no recorded drives in {DATA}; set THUMPER_DATA")


@pytest.mark.parametrize("number", numbers())
def test_the_gyroscope_corrects_the_heading_of_recorded_wheels(number: str) -> None:
    log = load(number)
    best = effective(log)
    assert rms_rad(log, WheelOdometry(GEOMETRIC)) > 1.0
    assert rms_rad(log, GyroEkf(GEOMETRIC, imu=IMU)) <= 0.20
    assert rms_rad(log, GyroEkf(best, imu=IMU)) <= 0.15
