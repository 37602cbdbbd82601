"""A bridge at PWM 0: the robot coasts, or the bridge shorts its motors; both in closed form."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from tests.hil.chip.conftest import BuildAvr
from tests.hil.chip.rig import Rig
from thumper_hil.chip.robot_params import RobotParams

RADIUS_M = 0.062
FROM_RAD_S = 8.0
PwmLow = Literal["coast", "brake"]


def with_pwm_low(params: RobotParams, pwm_low: PwmLow) -> RobotParams:
    return replace(params, board=replace(params.board, pwm_low=pwm_low))


def measured_stop(rig: Rig) -> tuple[float, float]:
    """Return time [s] and travel [rad] of a wheel from 8 rad/s to a stop."""
    start, rows = rig.chip.truth(), list[tuple[float, float, float]]()
    while rig.chip.truth().wheel_rad_s[0] != 0.0 and len(rows) < 2000:
        rig.run_for(0.001)
        truth = rig.chip.truth()
        rows.append((truth.time_s - start.time_s, truth.wheel_rad_s[0], truth.wheel_rad[0]))
    time_s, speed_rad_s, travel_rad = np.array(rows).T
    assert speed_rad_s[-1] == 0.0
    return tuple(
        float(column[-1] - np.interp(-FROM_RAD_S, -speed_rad_s, column)) for column in (time_s, travel_rad)
    )  # type: ignore[return-value]


def closed_form(params: RobotParams, damping_Nm_s_rad: float) -> tuple[float, float]:
    """Return time [s] and travel [rad] to a stop from 8 rad/s by J dw/dt = -d w - Tc, for one motor."""
    motor = params.motor
    inertia = motor.inertia_kg_m2 + params.body.mass_kg * RADIUS_M**2 / 6.0
    log = math.log(1.0 + damping_Nm_s_rad * FROM_RAD_S / motor.coulomb_Nm)
    time_s = inertia / damping_Nm_s_rad * log
    return time_s, inertia / damping_Nm_s_rad * (FROM_RAD_S - motor.coulomb_Nm / damping_Nm_s_rad * log)


def fast(build_avr: BuildAvr, params: RobotParams) -> Rig:
    """Return a robot that rolls straight ahead at more than 10 rad/s."""
    rig = Rig(build_avr("bridge"), params)
    rig.set(200, 200)
    rig.run_for(1.0)
    return rig


@pytest.mark.parametrize("pwm_low", ["coast", "brake"])
def test_stopping_time_and_distance_match_the_closed_form(
    build_avr: BuildAvr, even_params: RobotParams, pwm_low: PwmLow
) -> None:
    """Coasting takes 0.50 s and 12.0 cm; shorted motors take 0.16 s and 2.7 cm."""
    rig = fast(build_avr, with_pwm_low(even_params, pwm_low))
    rig.set(0, 0)
    motor = even_params.motor
    shorted = motor.torque_Nm_A * motor.back_emf_V_s_rad / motor.resistance_Ohm
    damping = motor.viscous_Nm_s_rad + (shorted if pwm_low == "brake" else 0.0)
    assert measured_stop(rig) == pytest.approx(closed_form(even_params, damping), rel=0.01)


def test_floating_pins_always_coast(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """A chip in reset drives no pin, so no transistor conducts and nothing brakes."""
    rig = fast(build_avr, with_pwm_low(even_params, "brake"))
    rig.chip.hang_at(0)
    rig.chip.reset()
    expected = closed_form(even_params, even_params.motor.viscous_Nm_s_rad)
    assert measured_stop(rig) == pytest.approx(expected, rel=0.01)


def test_unknown_pwm_low_is_refused() -> None:
    board = RobotParams.load().board
    with pytest.raises(ValueError, match="coast or brake"):
        replace(board, pwm_low="freewheel")  # type: ignore[arg-type]


def test_default_is_the_trex_behaviour() -> None:
    """The T'REX has brake pins; its PWM alone does not brake."""
    assert RobotParams.load().board.pwm_low == "coast"
