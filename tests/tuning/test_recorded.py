"""Motors recorded by others; the data may not be redistributed."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thumper_tuning.identify.cross_validation import fit_percent
from thumper_tuning.identify.excitation_checks import UndeterminedError
from thumper_tuning.identify.motor import identify
from thumper_tuning.identify.partial import identify_partly
from thumper_tuning.identify.partial_motor import PartialMotor
from thumper_tuning.identify.prediction import predict
from thumper_tuning.identify.segments import split_segments
from thumper_tuning.logs.motor_log import MotorLog
from thumper_tuning.logs.read import read_logs

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2].parent / "shared" / "data")) / "motor"
STEPS = sorted(DATA.glob("geared-steps-odd/*.csv"))
DRIVETRAIN = DATA / "drivetrain-sysid" / "sysid_data.json"

pytestmark = pytest.mark.skipif(not STEPS, reason=f"no recorded motors in {DATA}; set THUMPER_DATA")


def test_steps_of_a_geared_motor_are_predicted() -> None:
    """Held-out tenths of five open-loop steps; the driver's nonlinear map gives a negative friction."""
    logs = [read_logs(path, counts_per_rev=1320.0)[0] for path in STEPS]
    motor = identify(logs)
    assert motor.validation.fit_percent >= 93.0
    assert motor.model.friction < 0.0
    assert any("negative" in warning for warning in motor.warnings)
    assert motor.model.time_constant_s == pytest.approx(0.091, abs=0.01)
    # Published: 40 ms and a window of 50 ms. No speed of these rows shows them apart.
    assert motor.model.delay_s == pytest.approx(0.04, abs=1.5 * motor.uncertainty.delay_s)
    assert motor.sensor_window_s == pytest.approx(0.05, abs=1.5 * motor.uncertainty.sensor_window_s)
    assert motor.uncertainty.delay_s < motor.model.delay_s
    assert any("delay plus half the window, 63 ms" in warning for warning in motor.warnings)


def test_one_step_alone_determines_time_constant_delay_and_speed() -> None:
    """Five steps of one motor, each alone: the time constants scatter around the joint fit's 91 ms."""
    found = [_partly(read_logs(path, counts_per_rev=1320.0)) for path in STEPS]
    assert all(0.07 < motor.time_constant_s < 0.14 for motor in found)
    assert all(0.03 < motor.delay_s < 0.09 for motor in found)
    assert all(len(motor.steady) == 1 for motor in found)


def test_a_step_of_full_power_with_glitches() -> None:
    """The log that most makers have: commas and blanks, Spanish names, 0 to 255, glitches at the start."""
    motor = _partly(read_logs(DATA / "single-step" / "step_response.csv"))
    assert 0.06 <= motor.time_constant_s <= 0.11
    assert [(s.drive, round(s.speed_rad_s, 1)) for s in motor.steady] == [(255.0, 11.4)]
    assert "gain_rad_s_per_pwm" in motor.not_determined
    assert any("2 of 298 speeds are glitches" in warning for warning in motor.warnings)
    assert any("same row as the drive" in warning for warning in motor.warnings)
    assert motor.record_next.startswith("Record at least 20 s at 10 Hz or faster: steps to three levels")
    assert motor.reason.startswith("saturated: the drive is at its limit (255 pwm)")


def _partly(logs: list[MotorLog]) -> PartialMotor:
    with pytest.raises(UndeterminedError) as reason:
        identify(logs)
    return identify_partly(logs, reason.value)


@pytest.mark.parametrize(("held_out", "percent"), [(2, 88.0), (3, 85.0)])
def test_a_filtered_and_late_speed(held_out: int, percent: float) -> None:
    """A voltage step, predicted by a fit to both ramps and the other step."""
    (log,) = read_logs(DATA / "simple-sysid" / "sysid_data.json")
    assert "drive: SysId's voltage [V, -7 ... 7]" in log.columns
    edges = [*np.flatnonzero(log.starts_segment).tolist(), len(log.time_s)]
    assert len(edges) == 5

    def tests(numbers: list[int]) -> MotorLog:
        rows = np.concatenate([np.arange(edges[k], edges[k + 1]) for k in numbers])
        assert log.speed_rad_s is not None
        return replace(
            log,
            time_s=log.time_s[rows],
            drive=log.drive[rows],
            starts_segment=log.starts_segment[rows],
            speed_rad_s=log.speed_rad_s[rows],
        )

    motor = identify([tests([k for k in range(4) if k != held_out])])
    (step,) = split_segments(tests([held_out]))
    step = replace(step, sensor_window_s=motor.segments[0].sensor_window_s)
    predicted = predict(step, motor.model)
    assert fit_percent(step.speed_rad_s, step.speed_rad_s - predicted) >= percent
    assert motor.model.time_constant_s < 0.05
    assert next(iter(motor.fit_percent_by_kind)) == "steps", "the worst first"


@pytest.mark.parametrize(("side", "regression_percent"), [(0, (92.0, 68.0)), (1, (92.0, 63.0))])
def test_a_drive_train_is_predicted_better_than_by_regression(
    side: int, regression_percent: tuple[float, float]
) -> None:
    """Fit of simulated speeds, on ramps and steps, against the published regression's figures."""
    motor = identify([read_logs(DRIVETRAIN)[side]])
    first = 0
    for segment, bar in zip(motor.segments, np.repeat(regression_percent, 2), strict=True):
        last = first + len(segment.speed_rad_s)
        residual = motor.fit.residual_rad_s[first:last]
        assert fit_percent(segment.speed_rad_s, residual) > bar
        first = last
