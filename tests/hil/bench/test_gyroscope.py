"""A simulated robot carries a gyroscope: the host reads its rotation with the telemetry."""

import math

import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, GyroscopeState
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import Bench, simulation

TURN_S, STOP_S = 5.0, 2.0


@pytest.mark.parametrize("seed", [1, 2])
def test_the_increments_add_up_to_the_turn(seed: int) -> None:
    name = f"gyroscope-{seed}"
    board = Board.open(f"sim://{name}/board?preset=hard&seed={seed}", baud=500_000)
    bench: Bench = simulation(name)
    samples = board.poll(0.5)
    assert samples[-1].gyro_increment_rad is None
    board.set_parameter("gyroscope", 1)
    while samples[-1].telemetry.gyroscope is not GyroscopeState.READY:
        samples = board.poll(0.5)
        assert bench.time_s < 4.0
    board.command(Command.ARM)
    measured_rad = turned_rad = 0.0
    yaw_rad = bench.chip.truth().map_from_base.theta_rad
    end_s = bench.time_s + TURN_S + STOP_S
    while bench.time_s < end_s:
        speed_rad_s = 2.0 if bench.time_s < end_s - STOP_S else 0.0
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=-speed_rad_s, right_rad_s=speed_rad_s))
        for sample in board.poll(0.5):
            assert sample.gyro_increment_rad is not None
            measured_rad += sample.gyro_increment_rad
        now_rad = bench.chip.truth().map_from_base.theta_rad
        turned_rad += math.remainder(now_rad - yaw_rad, math.tau)
        yaw_rad = now_rad
    board.close()
    assert turned_rad > 2.0
    assert measured_rad == pytest.approx(turned_rad, abs=0.03)
