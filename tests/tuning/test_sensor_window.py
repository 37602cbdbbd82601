"""Logged speeds are means over a sensor's window: the fit estimates it, and its uncertainty counts."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import Wheel, steps_and_prbs

from thumper_tuning.identify.excitation_checks import UndeterminedError
from thumper_tuning.identify.fit import Fit, fit_motor
from thumper_tuning.identify.motor import identify
from thumper_tuning.identify.segments import split_segments
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

TAU_S = 0.06


def speed_log(window_s: float, row_s: float, delay_s: float, seconds: float = 8.0) -> MotorLog:
    """Return the log of a sensor that averages over `window_s`, of a wheel whose drive changes each 0.1 s."""
    wheel, step_s = Wheel(tau_s=TAU_S, delay_s=delay_s), 0.001
    time_s = np.arange(round(seconds / step_s), dtype=float) * step_s
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


def fitted(log: MotorLog) -> Fit:
    fit = fit_motor(split_segments(log))
    assert fit is not None
    return fit


def assert_covered(fit: Fit, window_s: float, delay_s: float) -> None:
    model, std = fit.model, fit.uncertainty
    assert model.time_constant_s == pytest.approx(TAU_S, abs=3.0 * std.time_constant_s)
    assert model.delay_s == pytest.approx(delay_s, abs=3.0 * std.delay_s)
    assert fit.sensor_window_s == pytest.approx(window_s, abs=max(3.0 * std.sensor_window_s, 1e-3))


@pytest.mark.parametrize(("window_s", "row_s"), [(0.0, 0.01), (0.042, 0.02)])
def test_a_window_is_found_with_its_uncertainty(window_s: float, row_s: float) -> None:
    """Also between those that the fit starts from, and for instantaneous speeds."""
    fit = fitted(speed_log(window_s, row_s, 0.03))
    assert fit.sensor_window_s == pytest.approx(window_s, abs=0.006)
    assert fit.model.time_constant_s == pytest.approx(TAU_S, rel=0.05)
    assert fit.model.delay_s == pytest.approx(0.03, abs=0.003)
    assert_covered(fit, window_s, 0.03)


@pytest.mark.parametrize(("window_s", "delay_s"), [(0.0, 0.03), (0.1, 0.0)])
def test_what_slow_rows_do_not_tell_apart_is_in_the_uncertainty(window_s: float, delay_s: float) -> None:
    """A delay and a window that end within a row have one effect: no fit can say which of them it is."""
    fit = fitted(speed_log(window_s, 0.1, delay_s, seconds=40.0))
    assert_covered(fit, window_s, delay_s)
    assert fit.uncertainty.delay_s > 0.003
    assert fit.uncertainty.time_constant_s < 0.006


def test_no_uncertainty_is_wider_than_delay_and_window_can_be() -> None:
    """Few counts per row: by the curvature of the fit alone, the delay would be 0 +- 58 ms."""
    time_s, quantum_rad = 0.05 * np.arange(800, dtype=float), math.tau / 48.0
    pwm = steps_and_prbs(800, 3)
    turned = np.floor(Wheel(delay_s=0.0, ripple=1.0).drive(time_s, pwm, 3) / quantum_rad) * quantum_rad
    log = MotorLog(
        name="wheel",
        drive_unit=DriveUnit.PWM,
        time_s=time_s,
        drive=pwm,
        starts_segment=np.arange(800) == 0,
        speed_rad_s=np.diff(turned, prepend=0.0) / 0.05,
    )
    motor = identify([log])
    std, total_s = motor.uncertainty, motor.model.delay_s + 0.5 * motor.sensor_window_s
    assert total_s == pytest.approx(0.025, abs=0.003)
    assert 0.3 * total_s < std.delay_s < total_s
    assert 0.6 * total_s < std.sensor_window_s < 2.0 * total_s
    assert any("25 ms, is surer" in warning for warning in motor.warnings)


def test_a_long_delay_in_fast_rows_is_found() -> None:
    fit = fitted(speed_log(0.02, 0.02, 0.15))
    assert fit.model.delay_s == pytest.approx(0.15, abs=0.005)


@pytest.mark.slow
def test_a_delay_beyond_the_search_is_not_determined() -> None:
    with pytest.raises(UndeterminedError, match="does not determine the delay: the fit ends at its limit"):
        identify([speed_log(0.02, 0.02, 0.75, seconds=16.0)])


def test_a_time_constant_beyond_the_search_is_not_determined() -> None:
    """The wheel reaches a tenth of its speed in a run: 60 s, and the search ends at 20 s."""
    rng = np.random.default_rng(1)
    pwm = np.repeat(rng.choice((-150.0, -80.0, 80.0, 150.0), 80), 10)
    speed_rad_s, decay = [0.0], math.exp(-0.05 / 60.0)
    for u in pwm[:-1]:
        speed_rad_s.append(0.06 * (u - math.copysign(19.0, u)) * (1.0 - decay) + decay * speed_rad_s[-1])
    log = MotorLog(
        name="slow",
        drive_unit=DriveUnit.PWM,
        time_s=np.arange(len(pwm), dtype=float) * 0.05,
        drive=pwm,
        starts_segment=np.arange(len(pwm)) == 0,
        speed_rad_s=np.array(speed_rad_s) + rng.normal(0.0, 0.01, len(pwm)),
    )
    with pytest.raises(UndeterminedError, match="determine the time constant: the fit ends at its limit"):
        identify([log])


def low_passed(log: MotorLog, filter_s: float) -> MotorLog:
    """Return the log with its speeds smoothed as `speed += share * (raw - speed)`."""
    assert log.speed_rad_s is not None
    share, smooth = -math.expm1(-log.period_s / filter_s), [0.0]
    for raw in log.speed_rad_s[1:]:
        smooth.append(smooth[-1] + share * (raw - smooth[-1]))
    return replace(log, speed_rad_s=np.array(smooth))


def test_a_low_pass_is_told_from_a_window() -> None:
    """It may hide behind the motor's time constant: the warning and the standard deviation include it."""
    motor = identify([low_passed(speed_log(0.02, 0.02, 0.0, seconds=16.0), 0.04)])
    (warning,) = [text for text in motor.warnings if "low-pass" in text]
    times_ms = [float(text) for text in re.findall(r"\b(\d+) (?:ms|and)", warning)]
    assert any(ms == pytest.approx(1e3 * TAU_S, rel=0.1) for ms in times_ms)
    assert any(ms == pytest.approx(40.0, rel=0.1) for ms in times_ms)
    assert motor.model.time_constant_s == pytest.approx(TAU_S, abs=2.0 * motor.uncertainty.time_constant_s)
    averaged = identify([speed_log(0.1, 0.02, 0.0, seconds=16.0)])
    assert not any("low-pass" in text for text in averaged.warnings)
