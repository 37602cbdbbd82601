"""Warnings about a fit that was accepted."""

import math
from collections.abc import Iterator

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.cross_validation import Validation
from thumper_tuning.identify.exponential_filter import FilteredModel
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.segments import LogSegment, all_speeds, median_window_s
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.units import FULL_PWM

WHITENESS_LIMIT = 2.576  # 99 % of a normal distribution
LAGS = 20
FEEDBACK_SIGMAS = 4.0
MIN_FIT_PERCENT, MIN_KIND_PERCENT = 85.0, 75.0  # of all speeds; of ramps, steps or random switching alone
INSEPARABLE = 0.2  # of the time constant
MIN_SENSOR_WINDOW_S = 0.03
SENSOR_SIGMAS, FILTERED_ROWS, INSTANTANEOUS_ROWS = 2.0, 1.2, 0.5
MIN_REPEATED_ROWS, MIN_REPEATED_SHARE = 2.0, 0.9
MAX_AUTOCORRELATION = 0.6  # a first-order wheel with torque ripple stays below it after one time constant


def fit_warnings(
    logs: list[MotorLog],
    segments: list[LogSegment],
    fit: Fit,
    validation: Validation,
    fit_percent_by_kind: dict[str, float],
) -> list[str]:
    """Return the warnings, most important first; none for a good log."""
    return [
        *_saturation_warnings(segments),
        *_validation_warnings(logs, segments, fit, validation, fit_percent_by_kind),
        *_delay_warnings(fit),
        *_repeat_warnings(segments),
        *_rate_warnings(segments, fit),
        *_feedback_warnings(logs, segments, fit, validation),
        *_drive_warnings(logs[0], segments, fit),
        *_resolution_warnings(logs, segments),
        *_friction_warnings(logs[0].drive_unit, fit),
        *_residual_warnings(segments, fit, validation),
    ]


def _saturation_warnings(segments: list[LogSegment]) -> Iterator[str]:
    clipped = np.concatenate([s.is_clipped for s in segments])
    if clipped.any():
        ceiling_rad_s = min(s.ceiling_rad_s for s in segments)
        yield (
            f"the speed is saturated: {100 * clipped.mean():.0f} % of the log stay at {ceiling_rad_s:.3g} "
            "rad/s while the drive increases; the rest is fitted; log counts, or speeds with a wider range"
        )


def _validation_warnings(
    logs: list[MotorLog],
    segments: list[LogSegment],
    fit: Fit,
    validation: Validation,
    fit_percent_by_kind: dict[str, float],
) -> Iterator[str]:
    worst = min(fit_percent_by_kind, key=lambda kind: fit_percent_by_kind[kind], default="")
    if validation.fit_percent < MIN_FIT_PERCENT:
        worst, percent = "speeds", validation.fit_percent
    else:
        percent = fit_percent_by_kind.get(worst, 100.0)
    if percent < (MIN_FIT_PERCENT if worst == "speeds" else MIN_KIND_PERCENT):
        yield (
            f"held-out {worst} are predicted to only {percent:.0f} %: noise, backlash, slip, or a battery "
            "whose voltage drops (log it as battery_V)"
        )
    glitches = int(fit.is_glitch.sum())
    if glitches:
        yield f"{glitches} of {len(all_speeds(segments))} speeds are glitches: left out"
    if fit.sensor_window_s is not None:
        yield from _sensor_warnings(fit.sensor_window_s, fit.uncertainty.sensor_window_s, logs)


def _sensor_warnings(window_s: float, std_s: float, logs: list[MotorLog]) -> Iterator[str]:
    row_s = max(log.period_s for log in logs)
    if window_s - SENSOR_SIGMAS * std_s > max(FILTERED_ROWS * row_s, MIN_SENSOR_WINDOW_S):
        yield f"the logged speeds are averaged over {1e3 * window_s:.0f} ms: log counts or raw speeds"
    elif window_s + SENSOR_SIGMAS * std_s < INSTANTANEOUS_ROWS * row_s:
        yield "the logged speeds are instantaneous values, not means over the row's interval"


def filter_warnings(fit: Fit, filtered: list[FilteredModel]) -> Iterator[str]:
    """Warn if a low-pass explains the logged speeds better than the window of the fit."""
    if not filtered:
        return
    best = filtered[0]
    motor_ms, filter_ms = 1e3 * best.model.time_constant_s, 1e3 * best.filter_s
    found = (
        f"one of {filter_ms:.0f} ms, and the motor's time constant is {motor_ms:.0f} ms"
        if len(filtered) == 1
        else f"{motor_ms:.0f} and {filter_ms:.0f} ms are those of motor and filter, or the reverse"
    )
    yield (
        f"the logged speeds passed a low-pass, not a window: {found}, not "
        f"{1e3 * fit.model.time_constant_s:.0f} ms; log counts or raw speeds"
    )


def _delay_warnings(fit: Fit) -> Iterator[str]:
    tau_s, delay_s, std = fit.model.time_constant_s, fit.model.delay_s, fit.uncertainty
    either_s = max(std.time_constant_s, std.delay_s)
    if either_s <= INSEPARABLE * tau_s:
        return
    if fit.sensor_window_s is not None and 2.0 * std.time_constant_s < std.delay_s < std.sensor_window_s:
        names, total = "delay and sensor's window", "delay plus half the window"
        total_s = delay_s + 0.5 * fit.sensor_window_s
    else:
        names, total, total_s = "delay and time constant", "their sum", tau_s + delay_s
    yield (
        f"{names} cannot be separated to better than {1e3 * either_s:.0f} ms: {total}, "
        f"{1e3 * total_s:.0f} ms, is surer; log faster, or log counts"
    )


def _repeat_warnings(segments: list[LogSegment]) -> Iterator[str]:
    """Warn if a new speed comes only each few rows: the drive then acts anywhere within them."""
    if segments[0].sensor_window_s is None or max(s.quantum_rad_s for s in segments) > 0.0:
        return  # coarse speeds repeat without that
    changes = [np.flatnonzero(np.diff(s.speed_rad_s)) for s in segments]
    rows = np.concatenate([np.diff(change) for change in changes])
    usual = float(np.median(rows)) if rows.size else 1.0
    if usual >= MIN_REPEATED_ROWS and float(np.mean(np.abs(rows - usual) <= 1.0)) > MIN_REPEATED_SHARE:
        held_ms = 1e3 * usual * median_window_s(segments)
        yield (
            f"each speed repeats for {held_ms:.0f} ms: the delay may be off by up to {held_ms:.0f} ms; raise "
            "the rate of the sensor, or of the motor controller's status frame"
        )


def _rate_warnings(segments: list[LogSegment], fit: Fit) -> Iterator[str]:
    period_s = median_window_s(segments)
    if fit.model.time_constant_s < 0.25 * period_s:
        yield (
            f"the time constant is below a quarter of the rows' interval ({period_s:g} s): log faster to be "
            "certain"
        )


def _feedback_warnings(
    logs: list[MotorLog], segments: list[LogSegment], fit: Fit, validation: Validation
) -> Iterator[str]:
    """Warn if the residuals move the drive that follows: then noise is in both, and biases the fit."""
    if not any(log.has_setpoint for log in logs):
        return
    changes, errors, first = [], [], 0
    for s in segments:
        last = first + len(s.speed_rad_s)
        change = np.diff(s.drive_at_windows())
        changes.append(change)
        errors.append(validation.residual_rad_s[first : last - 1] * ~fit.is_glitch[first : last - 1])
        first = last
    change, error = np.concatenate(changes), np.concatenate(errors)
    size = float(np.linalg.norm(change) * np.linalg.norm(error))
    share = abs(float(change @ error)) / size if size > 0.0 else 0.0
    if share > FEEDBACK_SIGMAS / np.sqrt(len(change)):
        yield (
            f"recorded in closed loop, and the drive reacts to what the model does not explain (correlation "
            f"{share:.2f}): gain and time constant may be biased; record open-loop steps to check"
        )
    else:
        yield "recorded in closed loop; no bias by the feedback is visible"


def _drive_warnings(log: MotorLog, segments: list[LogSegment], fit: Fit) -> Iterator[str]:
    unit, model, std = log.drive_unit, fit.model, fit.uncertainty
    drive = np.concatenate([s.drive for s in segments])
    smallest = np.abs(drive[drive != 0.0]).min()
    if model.friction < -2.0 * std.friction:
        yield (
            f"the static friction is negative ({model.friction:.2g} {unit.value}): the driver's voltage is "
            "not proportional to the command; read it as the offset of that map"
        )
    elif smallest > 0.9 * max(model.friction_forward, model.friction_backward, 0.0) and (
        std.friction > 0.25 * abs(model.friction)
    ):
        yield "the drive never came near the dead band: its width is extrapolated"
    # A drive beyond 255 has another limit, unless it only refers to the battery's mean voltage.
    largest = FULL_PWM * (1.0 if log.supply_V is None else 1.5)
    is_8_bit = unit is DriveUnit.PWM and float(np.abs(drive).max()) <= largest
    if is_8_bit and float(np.mean(np.abs(drive) >= FULL_PWM)) > 0.3:
        yield "the drive is at its limit for more than 30 % of the log: lower levels give better data"


def _resolution_warnings(logs: list[MotorLog], segments: list[LogSegment]) -> Iterator[str]:
    usual = max(float(np.percentile(np.abs(all_speeds(segments)), 90)), 1e-9)
    share = max(log.quantum_rad for log in logs) / median_window_s(segments) / usual
    if share > 0.1:
        yield f"one count is {100 * share:.0f} % of the usual speed: coarse; longer intervals would help"


def _friction_warnings(unit: DriveUnit, fit: Fit) -> Iterator[str]:
    model = fit.model
    if model.breakaway_ratio > 1.0:
        yield (
            f"the motor breaks away at {model.breakaway_ratio * model.friction:.3g} {unit.value}, above the "
            "friction in motion"
        )


def _residual_warnings(segments: list[LogSegment], fit: Fit, validation: Validation) -> Iterator[str]:
    # Torque noise passes the motor, so its effect lasts a time constant, and as long as a sensor averages it.
    # Counting alone gives a negative correlation at lag 1: a count missing in one window is in the next.
    lasts_s = fit.model.time_constant_s + (fit.sensor_window_s or 0.0)
    first = max(math.ceil(lasts_s / median_window_s(segments) - 1e-9), 1)
    correlation = autocorrelation(validation.residual_rad_s[~fit.is_glitch], first + LAGS)
    if float(np.max(correlation[first - 1 :], initial=0.0)) > MAX_AUTOCORRELATION:
        yield (
            "the residuals are not white: a first-order model does not explain all of this motor (backlash, "
            "battery voltage, load)"
        )


def autocorrelation(residual: FloatArray, lags: int = LAGS) -> FloatArray:
    """Return the normalized autocorrelation at lags 1 ... `lags`."""
    centred = residual - residual.mean()
    power = float(centred @ centred) or 1.0
    return np.array(
        [float(centred[k:] @ centred[:-k]) / power for k in range(1, min(lags, len(residual) - 1) + 1)]
    )
