"""A board whose bridges open at PWM 0: its roll-outs say nothing of the driven motor and must not mislead."""

import math

import numpy as np
import pytest

from thumper_tuning.drive.excitation import ExcitationOptions, blocks
from thumper_tuning.identify.motor import identify
from thumper_tuning.identify.segments import cut
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

GAIN, TIME_S, FRICTION_PWM = 0.0584, 0.075, 19.3
ROLLS_RAD_S2 = 15.0
RATE_HZ, STEP_S = 10.0, 0.001
QUANTUM_RAD = math.tau / 1200


def rolled(*, coasts: bool) -> MotorLog:
    """The usual experiment, counted at 10 Hz; at PWM 0 the wheel rolls out slowly, or as the model says."""
    side, levels = -1, list[float]()
    for block in blocks(ExcitationOptions(), RATE_HZ):
        side = -side
        levels += (side * block.levels).tolist()
    speed, angle, counts = 0.0, 0.0, [0]
    for pwm in levels:
        for _ in range(round(1.0 / RATE_HZ / STEP_S)):
            way = math.copysign(1.0, speed or pwm)
            pull = (GAIN * (pwm - way * FRICTION_PWM) - speed) / TIME_S
            after = speed + STEP_S * (-way * ROLLS_RAD_S2 if coasts and pwm == 0 else pull)
            speed = 0.0 if pwm == 0 and after * way <= 0.0 else after
            angle += STEP_S * speed
        counts.append(round(angle / QUANTUM_RAD))
    return MotorLog(
        name="left",
        drive_unit=DriveUnit.PWM,
        time_s=np.arange(len(counts)) / RATE_HZ,
        drive=np.array([*levels, 0.0]),
        begins=np.arange(len(counts)) == 0,
        position_rad=np.array(counts) * QUANTUM_RAD,
        quantum_rad=QUANTUM_RAD,
    )


@pytest.mark.parametrize("coasts", [False, True])
def test_the_motor_is_found_whatever_the_bridge_does_at_zero(coasts: bool) -> None:
    model = identify([rolled(coasts=coasts)]).model
    assert model.gain == pytest.approx(GAIN, rel=0.02)
    assert model.time_constant_s == pytest.approx(TIME_S, rel=0.05)
    assert 0.5 * (model.friction_forward + model.friction_backward) == pytest.approx(FRICTION_PWM, abs=1.5)


def test_no_roll_out_is_left_in_what_is_fitted() -> None:
    """Where the drive of a window is 0 the wheel stands, but for the last count."""
    for stretch in cut(rolled(coasts=True)):
        off = stretch.drive[:-1] == 0.0
        assert np.abs(stretch.speed_rad_s[off]).max(initial=0.0) <= QUANTUM_RAD * RATE_HZ
