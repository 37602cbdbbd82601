"""Logged speeds are means over a sensor's window: the fit estimates it, and its uncertainty counts."""

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import Wheel, steps_and_prbs

from thumper_tuning.identify.excitation_checks import UndeterminedError
from thumper_tuning.identify.motor import IdentifiedMotor, identify
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

TAU_S = 0.06


def speed_log(window_s: float, row_s: float, delay_s: float, seconds: float = 15.0) -> MotorLog:
    """Return the log of a sensor that averages over `window_s`, of a wheel whose drive changes each 0.1 s."""
    wheel, step_s = Wheel(tau_s=TAU_S, delay_s=delay_s), 0.001
    time_s = np.arange(round(seconds / step_s)) * step_s
    pwm = np.repeat(steps_and_prbs(round(seconds * 10.0), 3), round(0.1 / step_s))[: len(time_s)]
    angle_rad = wheel.drive(time_s, pwm, 3)
    rows = np.arange(0, len(time_s), round(row_s / step_s))
    averaged_s = max(window_s, step_s)
    before_rad = np.interp(time_s[rows] - averaged_s, time_s, angle_rad)
    noise_rad_s = 0.05 * np.random.default_rng(1).standard_normal(len(rows))
    return MotorLog(
        name="wheel",
        drive_unit=DriveUnit.PWM,
        time_s=time_s[rows],
        drive=pwm[rows],
        starts_segment=np.arange(len(rows)) == 0,
        speed_rad_s=(angle_rad[rows] - before_rad) / averaged_s + noise_rad_s,
    )


def assert_covered(motor: IdentifiedMotor, delay_s: float, sigmas: float = 3.0) -> None:
    model, std = motor.model, motor.uncertainty
    assert model.time_constant_s == pytest.approx(TAU_S, abs=sigmas * std.time_constant_s)
    assert model.delay_s == pytest.approx(delay_s, abs=sigmas * std.delay_s)


@pytest.mark.parametrize("window_s", [0.0, 0.042, 0.12])
def test_a_window_is_found_with_its_uncertainty(window_s: float) -> None:
    """Also between those that the fit starts from, and for instantaneous speeds."""
    motor = identify([speed_log(window_s, 0.01, 0.03)])
    assert motor.sensor_window_s == pytest.approx(window_s, abs=0.006)
    assert motor.model.time_constant_s == pytest.approx(TAU_S, rel=0.05)
    assert motor.model.delay_s == pytest.approx(0.03, abs=0.003)
    assert_covered(motor, 0.03)
    instantaneous = any("instantaneous values" in warning for warning in motor.warnings)
    assert instantaneous == (window_s == 0.0)


@pytest.mark.parametrize(("window_s", "delay_s"), [(0.0, 0.03), (0.05, 0.03), (0.1, 0.0)])
def test_what_slow_rows_do_not_tell_apart_is_in_the_uncertainty(window_s: float, delay_s: float) -> None:
    """A delay and a window that end within a row have one effect: no fit can say which of them it is."""
    motor = identify([speed_log(window_s, 0.1, delay_s, seconds=40.0)])
    assert_covered(motor, delay_s)
    assert motor.uncertainty.delay_s > 0.003
    assert motor.uncertainty.time_constant_s < 0.006
    assert motor.sensor_window_s == pytest.approx(window_s, abs=3.0 * motor.uncertainty.sensor_window_s)


def test_a_long_delay_in_fast_rows_is_found() -> None:
    motor = identify([speed_log(0.02, 0.01, 0.15)])
    assert motor.model.delay_s == pytest.approx(0.15, abs=0.005)


def test_a_delay_beyond_the_search_is_not_determined() -> None:
    with pytest.raises(UndeterminedError, match="does not determine the delay: the fit ends at its limit"):
        identify([speed_log(0.02, 0.02, 0.75, seconds=30.0)])
