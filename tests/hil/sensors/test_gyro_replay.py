"""A recorded drive with a gyroscope replays to the same poses, bit for bit."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.variants import some_of
from thumper.board.board import Board
from thumper.common.geometry import Pose2, wrap_angle
from thumper.config.robot import RobotConfig, with_ports
from thumper.imu.options import ImuModel, ImuOptions
from thumper.navigation.goal import Goal
from thumper.recording.reader import Recording
from thumper.recording.replay import replay
from thumper.recording.start_stop import recording_control
from thumper.ros.from_ros import stamp_ns_of
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench.registry import close_device, open_device

START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)


@pytest.mark.parametrize("model", some_of(["mpu6050", "bno08x"]))
def test_a_recorded_drive_replays_to_the_same_poses(model: ImuModel, tmp_path: Path) -> None:
    name = f"gyro-recorded-{model}"
    url = f"sim://{name}/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = with_ports(
        RobotConfig(imu=ImuOptions(enabled=True, model=model)), board=url, lidar=f"sim://{name}/lidar"
    )
    board = Board.open(url, baud=500_000)
    board.set_parameter("gyroscope", float(model == "mpu6050"))
    open_device(name, "witness", {})  # keeps the simulation and the board's parameter
    board.close()
    try:
        with (
            open_robot(config, START) as robot,
            recording_control(robot, config, START, tmp_path, print) as control,
        ):
            control.start()
            assert robot.run(drive_to_goal(Goal(x_m=0.8, y_m=0.05))).reached
            recorder = control.close()
            assert recorder is not None
            poses = robot.log.poses
    finally:
        close_device(name, "witness")
    imu = [m.decode() for m in Recording((recorder.files[0],)).messages() if m.topic == "imu"]
    assert len(imu) > (100 if model == "bno08x" else 20)
    stamps_s = [1e-9 * stamp_ns_of(m) for m in imu]
    turned_rad = sum(np.diff(stamps_s) * [m.angular_velocity.z for m in imu[1:]])
    assert wrap_angle(turned_rad - (poses[-1, 3] - poses[0, 3])) == pytest.approx(0.0, abs=0.05)
    again = {row[0]: tuple(row[1:]) for row in replay(Recording((recorder.files[0],))).path.tolist()}
    assert len(poses) > 20
    for time_s, x_m, y_m, theta_rad in poses.tolist():
        assert again[round(time_s * 1e9) / 1e9] == (x_m, y_m, theta_rad)
