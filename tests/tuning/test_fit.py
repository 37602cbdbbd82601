"""The fit against known plants: the specified accuracy, and logs with defects."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import COUNT_RAD, Wheel, counted, steps_and_prbs

from tests.variants import some_of
from thumper.common.geometry import FloatArray
from thumper_tuning.identify.fit import fit_motor
from thumper_tuning.identify.motor import IdentifiedMotor, identify
from thumper_tuning.identify.segments import split_segments
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.report.text import motor_lines

ROWS = 600


def make_log(wheel: Wheel, seed: int, *, rows: int = ROWS, time_s: FloatArray | None = None) -> MotorLog:
    pwm = steps_and_prbs(rows, seed)
    if time_s is None:
        time_s = np.arange(rows, dtype=float) * 0.1
    starts_segment = np.arange(rows) == 0
    counts = counted(wheel.drive(time_s, pwm, seed))
    return MotorLog(
        name="wheel",
        drive_unit=DriveUnit.PWM,
        time_s=time_s,
        drive=pwm,
        starts_segment=starts_segment,
        position_rad=counts * COUNT_RAD,
        quantum_rad=COUNT_RAD,
    )


def assert_found(motor: IdentifiedMotor, wheel: Wheel) -> None:
    model = motor.model
    assert model.gain == pytest.approx(wheel.gain, rel=0.02)
    assert model.time_constant_s == pytest.approx(wheel.tau_s, rel=0.05)
    assert model.friction == pytest.approx(wheel.friction, abs=2.0)
    assert motor.validation.fit_percent >= 93.0


@pytest.mark.parametrize("tau_s", [0.03, 0.075, 0.2, 0.3])
@pytest.mark.parametrize("seed", some_of(range(3)))
def test_known_plants_are_identified_from_10_Hz_logs(tau_s: float, seed: int) -> None:
    """`benchmarks/tuning.py` does the same with 20 seeds."""
    wheel = Wheel(tau_s=tau_s)
    assert_found(identify([make_log(wheel, seed)]), wheel)


@pytest.mark.parametrize("delay_s", [0.03, 0.1, 0.25])
def test_an_unknown_delay_is_identified(delay_s: float) -> None:
    wheel = Wheel(delay_s=delay_s)
    motor = identify([make_log(wheel, 4)])
    assert_found(motor, wheel)
    assert motor.model.delay_s == pytest.approx(delay_s, abs=0.004)


def test_a_friction_that_rounds_to_zero_has_no_sign() -> None:
    motor = identify([make_log(Wheel(), 4)])
    none = replace(motor.model, friction_forward=-0.001, friction_backward=0.0)
    printed = "\n".join(motor_lines(replace(motor, model=none)))
    assert "static friction       0.00 ± " in printed
    assert "-0.00" not in printed


def test_different_frictions_per_direction_are_identified() -> None:
    """The simulated wheel has one friction; an offset of the logged drive makes it two."""
    wheel = Wheel()
    log = make_log(wheel, 5)
    motor = identify([replace(log, drive=log.drive + 4.0 * np.sign(log.drive).clip(0.0))])
    assert motor.model.friction_forward == pytest.approx(wheel.friction + 4.0, abs=2.0)
    assert motor.model.friction_backward == pytest.approx(wheel.friction, abs=2.0)


def test_irregular_rows_do_not_matter() -> None:
    rng = np.random.default_rng(1)
    wheel = Wheel()
    assert_found(identify([make_log(wheel, 6, time_s=np.cumsum(rng.uniform(0.03, 0.25, ROWS)))]), wheel)


def test_glitches_are_left_out_with_a_warning() -> None:
    wheel, log = Wheel(), make_log(Wheel(), 7)
    assert log.position_rad is not None
    position = log.position_rad.copy()
    position[np.random.default_rng(2).choice(ROWS, 15, replace=False)] += 25.0
    position[400:] += 10.0
    motor = identify([replace(log, position_rad=position)])
    assert_found(motor, wheel)
    assert any("glitches" in note for note in motor.warnings)


def test_a_log_may_start_in_motion_and_have_gaps() -> None:
    wheel, log = Wheel(), make_log(Wheel(), 8)
    keep = np.flatnonzero((np.arange(ROWS) > 160) & ((np.arange(ROWS) < 300) | (np.arange(ROWS) > 340)))
    assert log.position_rad is not None
    starts_segment = np.concatenate(([True], np.diff(keep) > 1))
    motor = identify([
        replace(
            log,
            time_s=log.time_s[keep],
            drive=log.drive[keep],
            starts_segment=starts_segment,
            position_rad=log.position_rad[keep],
        )
    ])  # fmt: skip
    assert_found(motor, wheel)


def test_coarse_counts_do_not_bias() -> None:
    """48 counts per revolution: one count is a quarter of the slower level's speed."""
    wheel, log = Wheel(), make_log(Wheel(), 9)
    coarse = 2.0 * np.pi / 48.0
    position = np.floor(wheel.drive(log.time_s, log.drive, 9) / coarse) * coarse
    motor = identify([replace(log, position_rad=position, quantum_rad=coarse)])
    assert motor.model.gain == pytest.approx(wheel.gain, rel=0.03)
    assert motor.model.time_constant_s == pytest.approx(wheel.tau_s, rel=0.1)
    assert any("coarse" in note for note in motor.warnings)


def test_the_uncertainty_covers_the_error() -> None:
    """Over seeds, the errors have the size of the standard deviations."""
    wheel = Wheel(delay_s=0.03)
    scaled = []
    for seed in range(12):
        fit = fit_motor(split_segments(make_log(wheel, seed)))
        assert fit is not None
        model, std = fit.model, fit.uncertainty
        scaled.append(
            (
                (model.gain - wheel.gain) / std.gain,
                (model.time_constant_s - wheel.tau_s) / std.time_constant_s,
                (model.friction - wheel.friction) / std.friction,
            )
        )
    rms = np.sqrt(np.mean(np.square(scaled), axis=0))
    assert np.all((rms > 0.3) & (rms < 2.5))


def test_few_counts_per_row_are_merged_into_longer_windows() -> None:
    """48 counts per revolution at 50 Hz: one or two counts per row. The drive stays row by row."""
    wheel, rows = Wheel(delay_s=0.02), 2000
    quantum = 2.0 * np.pi / 48.0
    time_s = np.arange(rows, dtype=float) * 0.02
    pwm = np.repeat(steps_and_prbs(rows // 5, 3), 5)
    log = MotorLog(
        name="wheel",
        drive_unit=DriveUnit.PWM,
        time_s=time_s,
        drive=pwm,
        starts_segment=np.arange(rows) == 0,
        position_rad=counted(wheel.drive(time_s, pwm, 3), 48.0) * quantum,
        quantum_rad=quantum,
    )
    motor = identify([log])
    assert motor.model.gain == pytest.approx(wheel.gain, rel=0.02)
    assert motor.model.friction == pytest.approx(wheel.friction, abs=2.0)
    assert motor.model.time_constant_s == pytest.approx(
        wheel.tau_s, abs=3.0 * motor.uncertainty.time_constant_s
    )
    assert motor.validation.fit_percent > 80.0
