"""Logs that determine a part of the model: what is found is right, and what is missing is named."""

import json
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import COUNT_RAD, Wheel, counted

from tests.tuning.test_csv import Fit, fit
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper_tuning.cli.fit import fit_files
from thumper_tuning.cli.tune import design

__all__ = ["fit"]
WHEEL = Wheel(delay_s=0.02, ripple=1.0)


def counts_of(time_s: FloatArray, pwm: FloatArray) -> FloatArray:
    return counted(WHEEL.drive(time_s, pwm, 1))


@pytest.mark.parametrize("rows", [60, 250])
@pytest.mark.parametrize("level", [120.0, 255.0, -255.0])
def test_one_level(fit: Fit, level: float, rows: int) -> None:
    """One step from rest: time constant, delay and speed are right; gain and friction are not claimed."""
    time_s = 0.02 * np.arange(rows, dtype=float)
    pwm = np.where(time_s < 0.2, 0.0, level)
    result = fit("time_s,pwm,counts", time_s, pwm, counts_of(time_s, pwm))
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.12)
    assert result["delay_s"] == pytest.approx(WHEEL.delay_s, abs=0.008)
    speed = WHEEL.gain * (level - np.copysign(WHEEL.friction, level))
    steady = result["steady"]
    assert isinstance(steady, list)
    assert len(steady) == 1
    assert steady[0]["drive_pwm"] == level
    assert steady[0]["speed_rad_s"] == pytest.approx(speed, rel=0.03)
    assert result["not_determined"] == ["gain_rad_s_per_pwm", "static_friction_pwm"]
    assert "gain_rad_s_per_pwm" not in result
    assert "random switching" in str(result["record_next"])


@pytest.mark.parametrize("period_s", [0.02, 0.05])
def test_full_power_in_both_directions(fit: Fit, period_s: float) -> None:
    """The friction that the log does not determine is in the time constant's standard deviation."""
    time_s = period_s * np.arange(400, dtype=float)
    pwm = 255.0 * np.sign(np.sin(2.0 * time_s))
    result = fit("time_s,pwm,counts", time_s, pwm, counts_of(time_s, pwm))
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, abs=2.0 * result["time_constant_s_std"])  # type: ignore[operator]
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.25)
    assert len(result["steady"]) == 2  # type: ignore[arg-type]
    assert "saturated" in str(result["reason"])
    assert "reverses without a rest" in str(result["warnings"])


def test_one_direction_with_several_levels_is_a_whole_model(fit: Fit) -> None:
    """The friction of the other direction is unknown, and said to be so."""
    time_s = 0.05 * np.arange(600, dtype=float)
    pwm = np.repeat(np.tile((60.0, 200.0, 110.0, 0.0), 8), 19)[:600]
    result = fit("time_s,pwm,counts", time_s, pwm, counts_of(time_s, pwm))
    assert result["gain_rad_s_per_pwm"] == pytest.approx(WHEEL.gain, rel=0.02)
    assert result["static_friction_pwm"] == pytest.approx(WHEEL.friction, abs=2.0)
    assert "one direction only" in str(result["warnings"])
    assert result["static_friction_forward_pwm"] == pytest.approx(WHEEL.friction, abs=2.0)
    assert result["static_friction_backward_pwm"] is None
    assert set(result["fit_percent_by_kind"]) == {"steps"}  # type: ignore[call-overload]


def test_what_a_part_determines_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time_s = 0.02 * np.arange(250, dtype=float)
    pwm = np.where(time_s < 0.2, 0.0, 120.0)
    rows = np.column_stack((time_s, pwm, counts_of(time_s, pwm)))
    log = tmp_path / "step.csv"
    np.savetxt(log, rows, delimiter=",", header="time_s,pwm,counts", comments="")
    fit_files([log], counts_per_rev=1200, as_json=False, export=tmp_path)
    assert f"wrote {tmp_path / 'models.json'}" in capsys.readouterr().out
    models = json.loads((tmp_path / "models.json").read_text())
    system = next(system for name, system in models["systems"].items() if name.endswith("_counted"))
    assert system["period_s"] == 0.02
    assert sum(system["numerator"]) / sum(system["denominator"]) == pytest.approx(
        WHEEL.gain * (1.0 - WHEEL.friction / 120.0), rel=0.03
    )


def steps_with_noise(wheel: Wheel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, drive and a noisy speed of 15 steps from rest."""
    time_s = 0.02 * np.arange(1500, dtype=float)
    pwm = np.repeat(np.tile((0.0, 90.0, 0.0, -150.0, 0.0, 200.0), 5), 50)
    noise_rad_s = np.random.default_rng(4).normal(0.0, 0.15, 1500)
    counts = counted(wheel.drive(time_s, pwm, 1))
    return time_s, pwm, np.diff(counts, prepend=0.0) * COUNT_RAD / 0.02 + noise_rad_s


@pytest.mark.slow
def test_noise_before_a_step_is_no_start_in_motion(fit: Fit) -> None:
    result = fit("time_s,pwm,speed_rad_s", *steps_with_noise(WHEEL))
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.1)
    assert result["warnings"] == []


@pytest.mark.slow
def test_noise_does_not_hide_that_drive_and_motion_start_in_one_row(fit: Fit) -> None:
    """The loop sets the PWM, waits, measures and logs: the row holds the drive before it."""
    time_s, pwm, speed = steps_with_noise(Wheel())
    result = fit("time_s,pwm,speed_rad_s", time_s[1:], pwm[:-1], speed[1:])
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.05)
    assert "starts in the same row as the drive" in str(result["warnings"])


def test_glitches_are_named_with_their_time(fit: Fit) -> None:
    time_s = 0.02 * np.arange(200, dtype=float)
    pwm = np.where(time_s < 0.2, 0.0, 200.0)
    speed = np.diff(counts_of(time_s, pwm), prepend=0.0) * COUNT_RAD / 0.02
    speed[[60, 90]] = 40.0
    result = fit("time_s,pwm,speed_rad_s", time_s, pwm, speed)
    assert "2 of 199 speeds are glitches: left out (40 rad/s at 1.20 s, 40 rad/s at 1.80 s)" in str(
        result["warnings"]
    )
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.12)


def test_noise_determines_nothing(fit: Fit) -> None:
    time_s = 0.02 * np.arange(200, dtype=float)
    pwm = np.where(time_s < 0.2, 0.0, 200.0)
    with pytest.raises(ThumperError, match="one drive level only"):
        fit("time_s,pwm,speed_rad_s", time_s, pwm, np.random.default_rng(0).normal(0.0, 3.0, 200))


def test_a_wheel_that_is_determined_and_one_that_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both are printed; a design needs the whole model and refuses the partial one with what to record."""
    time_s = 0.05 * np.arange(600, dtype=float)
    left = np.repeat(np.tile((60.0, 200.0, -110.0, 0.0, -60.0, -180.0), 6), 19)[:600]
    right = np.where(time_s < 0.2, 0.0, 200.0)
    path = tmp_path / "log.csv"
    table = np.column_stack((time_s, left, counts_of(time_s, left), right, counts_of(time_s, right)))
    header = "time_s,left_pwm,left_counts,right_pwm,right_counts"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    fit_files([path], counts_per_rev=1200.0, as_json=True)
    printed = json.loads(capsys.readouterr().out)
    assert "gain_rad_s_per_pwm" in printed["left"]
    assert "not_determined" in printed["right"]
    with pytest.raises(ThumperError, match="right: one drive level only"):
        design([path], out=tmp_path)


@pytest.mark.parametrize("delay_s", [0.05, 0.1])
def test_a_drive_that_is_on_from_the_first_row(fit: Fit, delay_s: float) -> None:
    """Noise of the speed at rest does not hide that the motor starts from rest."""
    time_s = 0.02 * np.arange(150, dtype=float)
    speed = 10.0 * -np.expm1(-np.clip(time_s - delay_s, 0.0, None) / 0.08)
    speed += np.random.default_rng(1).normal(0.0, 0.03, 150)
    result = fit("time_s,pwm,speed_rad_s", time_s, np.full(150, 200.0), speed)
    assert result["time_constant_s"] == pytest.approx(0.08, rel=0.1)
    assert result["delay_s"] == pytest.approx(delay_s, abs=0.012)
    assert 0.0 < float(str(result["delay_s_std"])) < 0.01


def test_a_start_in_motion_does_not_determine_the_delay(fit: Fit) -> None:
    """One drive throughout shows the time constant of the run-up, but not when the drive began to act."""
    time_s = 0.02 * np.arange(150, dtype=float)
    speed = 10.0 - 7.0 * np.exp(-time_s / 0.2) + np.random.default_rng(1).normal(0.0, 0.03, 150)
    result = fit("time_s,pwm,speed_rad_s", time_s, np.full(150, 200.0), speed)
    assert result["time_constant_s"] == pytest.approx(0.2, rel=0.1)
    assert result["delay_s"] is None
    assert "delay_s" in str(result["not_determined"])


def test_a_step_of_a_controller_is_one_level_with_a_warning(fit: Fit) -> None:
    """The noise moves the drive, so the drive that holds the speed has many values."""
    noise_rad_s = np.random.default_rng(3).normal(0.0, 0.05, 200)
    target = np.where(np.arange(200) < 30, 0.0, 6.0)
    pwm, speed = np.zeros(200), np.zeros(200)
    truth_rad_s = integral = 0.0
    for k in range(200):
        speed[k] = truth_rad_s + noise_rad_s[k]
        integral += 4.0 * (target[k] - speed[k])
        pwm[k] = np.round(30.0 * (target[k] - speed[k]) + integral)
        drive = max(abs(pwm[k]) - 20.0, 0.0) * np.sign(pwm[k])
        truth_rad_s += (0.06 * drive - truth_rad_s) * -np.expm1(-0.02 / 0.08)
    result = fit("time_s,setpoint,pwm,speed_rad_s", 0.02 * np.arange(200.0), target, pwm, speed)
    steady = result["steady"]
    assert isinstance(steady, list)
    assert len(steady) == 1
    assert steady[0]["drive_pwm"] == pytest.approx(120.0, abs=1.0)
    assert steady[0]["speed_rad_s"] == pytest.approx(6.0, abs=0.05)
    assert "recorded in closed loop" in str(result["warnings"])
    assert " in 90 % of the rows" in str(result["reason"])


def assert_static(result: dict[str, object], wheel: Wheel) -> None:
    """Assert that gain and friction are right, and that no time constant or delay is claimed."""
    friction_std = float(str(result["static_friction_pwm_std"]))
    assert result["gain_rad_s_per_pwm"] == pytest.approx(wheel.gain, rel=0.01)
    assert result["static_friction_pwm"] == pytest.approx(wheel.friction, abs=2.0 * friction_std)
    assert friction_std < 1.5
    assert result["time_constant_s"] is None
    assert result["delay_s"] is None
    assert {"time_constant_s", "delay_s"} <= set(result["not_determined"])  # type: ignore[call-overload]


def test_slow_ramps_in_both_directions(fit: Fit) -> None:
    """Ripple moves the break-away, the only part that shows the lag apart from the friction."""
    wheel = Wheel(tau_s=0.12, delay_s=0.01, static_ratio=1.0)
    time_s = 0.02 * np.arange(1050, dtype=float)
    ramp = np.floor(20.0 * 0.02 * np.arange(500.0))
    pwm = np.concatenate((ramp, np.zeros(50), -ramp))
    assert_static(fit("time_s,pwm,counts", time_s, pwm, counted(wheel.drive(time_s, pwm, 3))), wheel)


def test_a_slow_ramp_gives_gain_and_friction(fit: Fit) -> None:
    """Without the friction that it does not know, a linear model explains a ramp by a lag of 1 s."""
    time_s = 0.02 * np.arange(500, dtype=float)
    pwm = np.floor(20.0 * time_s)
    turned_s = np.clip(time_s - WHEEL.friction / 20.0 - WHEEL.tau_s, 0.0, None)
    position = WHEEL.gain * 20.0 * turned_s**2 / 2.0
    result = fit("time_s,pwm,counts", time_s, pwm, np.floor(position / COUNT_RAD))
    assert_static(result, WHEEL)
    assert "static_friction_backward_pwm" in str(result["not_determined"])
    assert "random switching" in str(result["record_next"])


def test_reversals_widen_the_delays_standard_deviation(fit: Fit) -> None:
    time_s = 0.02 * np.arange(600, dtype=float)
    pwm = 120.0 * np.sign(np.sin(np.pi * (time_s + 0.01)))
    result = fit("time_s,pwm,counts", time_s, pwm, counts_of(time_s, pwm))
    assert result["delay_s"] == pytest.approx(WHEEL.delay_s, abs=2.0 * result["delay_s_std"])  # type: ignore[operator]
