"""The heading of a simulated robot that drives curves, with and without a gyroscope; real firmware."""

import math

import numpy as np

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.common.geometry import FloatArray
from thumper.common.kinematics import DriveGeometry, WheelSpeeds
from thumper.imu.open_imu import open_imu
from thumper.imu.options import ImuModel, ImuOptions
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.wheel_odometry import WheelOdometry
from thumper_hil.bench import simulation

DRIVE_S = 120.0


def heading_errors(name: str, model: ImuModel, seed: int) -> FloatArray:
    """Drive curves and turns for two minutes, with the track of the drawing.

    Return rows: time [s], heading error with the gyroscope and by the wheels alone [rad]. An error of more
    than half a turn is not wrapped.
    """
    options = ImuOptions(enabled=True, model=model, port=f"sim://{name}/imu")
    board = Board.open(f"sim://{name}/board?world=hall&seed={seed}", baud=500_000)
    board.set_parameter("gyroscope", float(model == "mpu6050"))
    bench = simulation(name)
    imu = open_imu(options) if model == "bno08x" else None
    fused, wheels = GyroEkf(DriveGeometry(), imu=options), WheelOdometry(DriveGeometry())
    rows = []
    try:
        bench.advance(bench.time_s + 2.0)
        board.poll(0.0)
        start_rad, start_s = float(bench.truth()[-1, 3]), bench.time_s
        board.command(Command.ARM)
        while bench.time_s < start_s + DRIVE_S:
            turn = 2.5 * math.sin(0.4 * (bench.time_s - start_s)) + 2.0
            board.set_wheel_speeds(WheelSpeeds(left_rad_s=1.0 - turn, right_rad_s=1.0 + turn))
            samples = board.poll(0.15)
            for reading in imu.poll() if imu else ():
                fused.add_imu(reading)
            for sample in samples:
                counts = (sample.telemetry.left_count, sample.telemetry.right_count)
                gyro_rad = sample.gyro_increment_rad if imu is None else None
                odometry = fused.update(sample.time_s, *counts, gyro_rad=gyro_rad)
                assert abs(odometry.twist.w_rad_s) < 10.0, "a step of the heading"
                poses = (odometry.odom_from_base, wheels.update(sample.time_s, *counts).odom_from_base)
                truth = bench.truth()
                true_rad = np.interp(sample.time_s, truth[:, 0], np.unwrap(truth[:, 3])) - start_rad
                errors = (math.remainder(pose.theta_rad - true_rad, math.tau) for pose in poses)
                rows.append((sample.time_s - start_s, *errors))
    finally:
        board.close()
        if imu is not None:
            imu.close()
    times_s, *errors_rad = np.array(rows).T
    return np.column_stack((times_s, *(np.unwrap(one) for one in errors_rad)))
