"""Drive with a gyroscope: real firmware on the simulated chip, 1200 counts, 10 Hz, the wrong track."""

import math
from pathlib import Path

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.kinematics import DriveGeometry, WheelSpeeds
from thumper.common.serial_port import open_port
from thumper.config.robot import RobotConfig, with_ports
from thumper.imu.bno08x import Bno08xDriver
from thumper.imu.open_imu import open_imu
from thumper.imu.options import ImuModel, ImuOptions
from thumper.navigation.goal import Goal
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.wheel_odometry import WheelOdometry
from thumper.runtime.assembly import open_robot, wait_for_gyroscope
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench import simulation

DRIVE_S = 120.0
MISSION = "world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"


def headings(name: str, model: ImuModel, seed: int) -> tuple[float, float]:
    """Drive curves and turns for two minutes; return the heading's errors, fused and by the wheels [rad]."""
    options = ImuOptions(enabled=True, model=model, port=f"sim://{name}/imu")
    board = Board.open(f"sim://{name}/board?world=hall&seed={seed}", baud=500_000)
    board.set_parameter("gyroscope", float(model == "mpu6050"))
    bench = simulation(name)
    imu = open_imu(options) if model == "bno08x" else None
    fused, wheels = GyroEkf(DriveGeometry(), imu=options), WheelOdometry(DriveGeometry())
    try:
        bench.advance(bench.time_s + 2.0)
        board.poll(0.0)
        start_rad, start_s = float(bench.truth()[-1, 3]), bench.time_s
        board.command(Command.ARM)
        errors = [0.0, 0.0]
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
                poses = (odometry.odom_from_base, wheels.update(sample.time_s, *counts).odom_from_base)
                truth = bench.truth()
                true_rad = np.interp(sample.time_s, truth[:, 0], np.unwrap(truth[:, 3])) - start_rad
                assert abs(odometry.twist.w_rad_s) < 10.0, "a step of the heading"
                errors = [math.remainder(pose.theta_rad - true_rad, math.tau) for pose in poses]
        return abs(errors[0]), abs(errors[1])
    finally:
        board.close()
        if imu is not None:
            imu.close()


@pytest.mark.parametrize("model", [pytest.param("bno08x", marks=pytest.mark.slow), "mpu6050"])
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_the_heading_holds_for_two_minutes_with_an_uncalibrated_track(model: ImuModel, seed: int) -> None:
    fused_rad, wheels_rad = headings(f"gyro-{model}-{seed}", model, seed)
    print(f"{model}, seed {seed}: {fused_rad:.3f} rad, wheels alone {wheels_rad:.2f} rad")
    assert fused_rad <= 0.05


def config(name: str, model: ImuModel, more: str = "") -> RobotConfig:
    robot = RobotConfig(imu=ImuOptions(enabled=True, model=model), board=BoardOptions())
    return with_ports(robot, board=f"sim://{name}/board?{MISSION}{more}", lidar=f"sim://{name}/lidar")


START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)


def test_unplugged_in_a_drive_the_wheels_go_on_and_it_is_said(tmp_path: Path) -> None:
    scenario = tmp_path / "unplugged.toml"
    scenario.write_text('faults = [{ at_s = 4.0, imu = "unplugged" }]')
    with open_robot(config("gyro-unplugged", "bno08x", f"&scenario={scenario}"), START) as robot:
        bench = simulation("gyro-unplugged")
        events: list[str] = []
        robot.publisher.add_sink(lambda topic, _s, m: events.append(m.msg) if topic == "events" else None)
        assert bench.time_s < 4.0
        result = robot.run(drive_to_goal(Goal(x_m=-1.0, y_m=0.05)))
        assert robot.inputs.feeds[0].sensor.counters.samples > 100
    assert result.reached, result.reason
    assert bench.contacts == 0
    assert any("no rate from the gyroscope" in text for text in events)


def test_a_board_without_a_gyroscope_is_refused() -> None:
    with (
        pytest.raises(
            ThumperError, match=r"does not use its gyroscope: start with \[imu\] enabled = false"
        ) as refusal,
        open_robot(config("gyro-off", "mpu6050"), START),
    ):
        pass
    assert refusal.value.exit_code == 3
    assert "\n" not in str(refusal.value)


def test_a_board_whose_gyroscope_does_not_answer_is_refused() -> None:
    board = Board.open("sim://gyro-dead/board?world=lab", baud=500_000)
    board.set_parameter("gyroscope", 1.0)
    bench = simulation("gyro-dead")
    bench.chip.power_gyroscope(on=False)
    bench.advance(bench.time_s + 0.3)
    board.poll(0.0)  # what it sent before
    with pytest.raises(ThumperError, match="no MPU-6050 answers on the board: check SDA"):
        wait_for_gyroscope(board)
    board.close()


def test_another_device_on_the_port_is_refused() -> None:
    lidar = open_port("sim://gyro-other/lidar?world=lab&lidar=ld19", baud=230_400, name="lidar")
    with pytest.raises(ThumperError, match="is not a BNO08x in UART-RVC mode; correct") as refusal:
        Bno08xDriver(lidar)
    lidar.close()
    assert refusal.value.exit_code == 3
    assert "\n" not in str(refusal.value)
