"""Boards whose bridges open at PWM 0: coasting must not bias the model of the driven motor."""

import math

import numpy as np
import pytest

from tests.variants import some_of
from thumper_tuning.drive.excitation import ExcitationOptions, excitation_blocks
from thumper_tuning.identify.motor import identify
from thumper_tuning.identify.segments import split_segments
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

GAIN, TIME_S, FRICTION_PWM = 0.0584, 0.075, 19.3
COASTING_RAD_S2 = 15.0
RATE_HZ, STEP_S = 10.0, 0.001
QUANTUM_RAD = math.tau / 1200
VOLTS_PER_PWM = 7.2 / 255.0


def simulated_log(*, coasts: bool, unit: DriveUnit = DriveUnit.PWM) -> MotorLog:
    """Return the standard experiment at 10 Hz; at PWM 0 the wheel coasts, or brakes as the model does."""
    direction, levels = -1, list[float]()
    for block in excitation_blocks(ExcitationOptions(), RATE_HZ):
        direction = -direction
        levels += (direction * block.levels).tolist()
    speed, angle, counts = 0.0, 0.0, [0]
    for pwm in levels:
        for _ in range(round(1.0 / RATE_HZ / STEP_S)):
            sign = math.copysign(1.0, speed or pwm)
            driven = (GAIN * (pwm - sign * FRICTION_PWM) - speed) / TIME_S
            after = speed + STEP_S * (-sign * COASTING_RAD_S2 if coasts and pwm == 0 else driven)
            speed = 0.0 if pwm == 0 and after * sign <= 0.0 else after
            angle += STEP_S * speed
        counts.append(round(angle / QUANTUM_RAD))
    return MotorLog(
        name="left",
        drive_unit=unit,
        time_s=np.arange(len(counts)) / RATE_HZ,
        drive=np.array([*levels, 0.0]) * (VOLTS_PER_PWM if unit is DriveUnit.VOLT else 1.0),
        starts_segment=np.arange(len(counts)) == 0,
        position_rad=np.array(counts) * QUANTUM_RAD,
        quantum_rad=QUANTUM_RAD,
    )


@pytest.mark.parametrize("coasts", some_of([True, False]))
def test_the_motor_is_identified_whether_it_coasts_or_brakes(coasts: bool) -> None:
    model = identify([simulated_log(coasts=coasts)]).model
    assert model.gain == pytest.approx(GAIN, rel=0.02)
    assert model.time_constant_s == pytest.approx(TIME_S, rel=0.05)
    assert 0.5 * (model.friction_forward + model.friction_backward) == pytest.approx(FRICTION_PWM, abs=1.5)


@pytest.mark.parametrize("coasts", [False, True])
def test_a_log_in_volts_shows_whether_the_bridge_opens_at_zero(coasts: bool) -> None:
    found = identify([simulated_log(coasts=coasts, unit=DriveUnit.VOLT)])
    assert found.model.gain * VOLTS_PER_PWM == pytest.approx(GAIN, rel=0.02)
    assert found.model.time_constant_s == pytest.approx(TIME_S, rel=0.05)
    friction_V = 0.5 * (found.model.friction_forward + found.model.friction_backward)
    assert friction_V == pytest.approx(FRICTION_PWM * VOLTS_PER_PWM, abs=1.5 * VOLTS_PER_PWM)
    assert any("coasts" in warning for warning in found.warnings) is coasts


def test_coasting_is_excluded_from_the_fit() -> None:
    """Where the drive of a window is 0 the wheel is at rest, except for the last count."""
    for segment in split_segments(simulated_log(coasts=True)):
        off = segment.drive[:-1] == 0.0
        assert np.abs(segment.speed_rad_s[off]).max(initial=0.0) <= QUANTUM_RAD * RATE_HZ
