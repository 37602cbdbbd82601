"""One coefficient of friction gives grip and turning resistance; the robot turns on every floor but one."""

import math
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import simulation
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.effects.friction import TOO_MUCH, floor_friction, floors, scrub_moment_Nm, traction_Nm
from thumper_hil.effects.preset import Preset, load_preset


def turn_on(floor: str, turn_rad: float = math.tau) -> tuple[float, Fault]:
    """Turn on the spot at 0.6 rad/s with a battery at 10 %; return the angle and the board's fault."""
    nominal = load_preset("nominal")

    def on_floor(_name: str) -> Preset:
        return replace(nominal, body=replace(nominal.body, floor=floor))

    with patch("thumper_hil.bench.bench.load_preset", on_floor):
        board = Board.open(f"sim://{floor}/board?world=hall&charge=0.1", baud=500_000)
    bench = simulation(floor)
    board.command(Command.ARM)
    turned_rad, before_rad, fault = 0.0, 0.0, Fault.NONE
    while turned_rad < turn_rad and bench.time_s < 30.0 and fault is Fault.NONE:
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=-1.78, right_rad_s=1.78))
        for sample in board.poll(0.5):
            fault = sample.telemetry.fault
        now_rad = bench.chip.truth().map_from_base.theta_rad
        turned_rad += math.remainder(now_rad - before_rad, math.tau)
        before_rad = now_rad
    board.close()
    return turned_rad, Fault(fault)


@pytest.mark.parametrize("floor", sorted(floors().keys() - {"stand"}))
def test_the_robot_turns_a_full_circle_or_the_floor_is_too_much(floor: str) -> None:
    turned_rad, fault = turn_on(floor)
    if floor in TOO_MUCH:
        assert fault is Fault.OVER_CURRENT
    else:
        assert fault is Fault.NONE
        assert turned_rad > 6.2


def test_grip_and_turning_resistance_come_from_one_coefficient() -> None:
    body = RobotParams.load().body
    rough = replace(body, friction=2.0 * body.friction)
    assert rough.scrub_Nm == pytest.approx(2.0 * body.scrub_Nm)
    assert rough.traction_Nm == pytest.approx(2.0 * body.traction_Nm)
    assert body.friction == floor_friction("wood")


def test_the_moment_is_that_of_six_sliding_tyres() -> None:
    """Without longitudinal sliding only the four corner tyres slide, 0.14 m from the centre."""
    weight_N = 4.7 * 9.81 / 6.0
    assert scrub_moment_Nm(0.6, 4.7, 2 * 0.1225) == pytest.approx(4 * 0.6 * weight_N * 0.14)
    assert traction_Nm(0.6, 4.7, 0.062) == pytest.approx(3 * 0.6 * weight_N * 0.062)


def test_an_unknown_floor_is_refused() -> None:
    with pytest.raises(ThumperError, match="carpet"):
        floor_friction("ice")


def test_the_mass_is_chassis_and_payload() -> None:
    params: Any = RobotParams.load()
    assert params.body.mass_kg == pytest.approx(2.7 + 2.0)
