"""Drive with a gyroscope: real firmware on the simulated chip, 1200 counts, 10 Hz, the wrong track."""

import math
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.gyro_heading import heading_errors

from thumper.board.board import Board
from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.serial_port import open_port
from thumper.config.robot import RobotConfig, with_ports
from thumper.imu.bno08x import Bno08xDriver
from thumper.imu.options import ImuModel, ImuOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot, wait_for_gyroscope
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench import simulation

MISSION = "world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"


@pytest.mark.parametrize("model", [pytest.param("bno08x", marks=pytest.mark.slow), "mpu6050"])
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_the_heading_holds_for_two_minutes_with_an_uncalibrated_track(model: ImuModel, seed: int) -> None:
    fused_rad, wheels_rad = np.abs(heading_errors(f"gyro-{model}-{seed}", model, seed)[-1, 1:])
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
