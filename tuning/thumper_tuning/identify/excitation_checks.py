"""Check whether a log can identify the motor; if it cannot, say why and what to record instead."""

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.common.geometry import FloatArray
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.segments import LogSegment
from thumper_tuning.logs.motor_log import BoolArray, DriveUnit, MotorLog
from thumper_tuning.logs.units import FULL_PWM

RECORD = (
    "record at least 20 s at 10 Hz or faster: steps to three levels in both directions, then random "
    "switching between two levels, as `thumper tune record` does"
)
MIN_WINDOWS = 30
MIN_PARTIAL_WINDOWS = 15
MIN_COUNTS = 30.0
MIN_DURATION_S = 3.0
LEVEL_RATIO = 1.15  # two drive levels are different if they are this far apart
MAX_RELATIVE_STD = {"gain": 0.15, "time_constant": 0.3}
MIN_FIT_PERCENT = 40.0
MIN_LAG_EFFECT = 0.03  # of the motion: steps and switching give above 0.1, slow ramps below 0.01
MAX_COARSE_VALUES = 4  # of the speed, without sign
MIN_FRICTION_RATIO = -0.2  # friction over the largest drive: more than a nonlinear driver explains


class UndeterminedError(ThumperError):
    """A log that determines a part of the model: `identify.partial` finds what it does determine."""


class NoLagError(UndeterminedError):
    """A log of slow ramps: its fit gives gain and static friction, but neither time constant nor delay."""

    def __init__(
        self, message: str, fit: Fit, segments: list[LogSegment], frictions: tuple[float, float]
    ) -> None:
        """Keep the fit, its segments, and the frictions forward and backward of the static map."""
        super().__init__(message, exit_code=EXIT_CHECK_FAILED)
        self.fit, self.segments, self.frictions = fit, segments, frictions


def unusable(message: str) -> ThumperError:
    """Return the error for a log whose data cannot identify a motor."""
    return ThumperError(message, exit_code=EXIT_CHECK_FAILED)


def undetermined(message: str) -> UndeterminedError:
    """Return the error with the exit code of a log that cannot be used."""
    return UndeterminedError(message, exit_code=EXIT_CHECK_FAILED)


def check_excitation(logs: list[MotorLog], segments: list[LogSegment]) -> None:
    """Reject a log that cannot identify a motor.

    Raises
    ------
    UndeterminedError
        One level, saturated, short: the log determines a part of the model.
    ThumperError
        No excitation, no motion, no sign, or too few rows.
    """
    name = logs[0].name
    drive = np.concatenate([s.drive for s in segments]) if segments else np.zeros(0)
    speed = np.concatenate([s.speed_rad_s for s in segments]) if segments else np.zeros(0)
    duration_s = sum(float(s.edge_s[-1] - s.edge_s[0]) for s in segments)
    if len(speed) < MIN_PARTIAL_WINDOWS:
        raise unusable(f"{name}: {len(speed)} samples in {duration_s:.1f} s are too few; {RECORD}")
    unit = logs[0].drive_unit.value
    if not drive.any():
        raise unusable(f"{name}: no excitation: the drive is 0 {unit} all the time; {RECORD}")
    quantum = max(log.quantum_rad for log in logs)
    moving = np.abs(speed) > max(0.02 * float(np.percentile(np.abs(speed), 95)), 1e-9)
    travelled_rad = sum(float(np.abs(s.speed_rad_s) @ s.windows_s) for s in segments)
    if not moving.any() or travelled_rad < MIN_COUNTS * quantum:
        raise unusable(
            f"{name}: the wheel does not move ({np.abs(drive).max():g} {unit} at most); drive it beyond "
            f"the dead band, check motor and encoder cables; {RECORD}"
        )
    _check_sign(name, drive, speed, moving)
    _check_levels(name, logs[0].drive_unit, drive)
    if len(speed) < MIN_WINDOWS or duration_s < MIN_DURATION_S:
        raise undetermined(f"{name}: {len(speed)} samples in {duration_s:.1f} s are too few; {RECORD}")


def turns_one_way(segments: list[LogSegment]) -> bool:
    """Return whether less than 4 % of the windows turn in the other direction."""
    speed = np.concatenate([s.speed_rad_s for s in segments])
    usual = float(np.percentile(np.abs(speed[speed != 0.0]), 75)) if speed.any() else 0.0
    return min(float(np.mean(speed > 0.2 * usual)), float(np.mean(speed < -0.2 * usual))) < 0.04


def _check_sign(name: str, drive: FloatArray, speed: FloatArray, moving: BoolArray) -> None:
    usual = float(np.percentile(np.abs(speed[moving]), 75))
    forward, backward = float(np.mean(speed > 0.2 * usual)), float(np.mean(speed < -0.2 * usual))
    largest = float(np.abs(drive).max())
    signs = min(float(np.mean(drive > 0.2 * largest)), float(np.mean(drive < -0.2 * largest)))
    if min(forward, backward) < 0.04 <= signs:
        raise unusable(
            f"{name}: the drive has both signs but the speed only one: the log lacks the sign of the speed; "
            "record counts that increase forward and decrease backward"
        )


def _check_levels(name: str, unit: DriveUnit, drive: FloatArray) -> None:
    nonzero = np.sort(np.abs(drive[np.abs(drive) > 0.05 * np.abs(drive).max()]))
    low, high = float(np.percentile(nonzero, 5)), float(np.percentile(nonzero, 95))
    if high >= LEVEL_RATIO * low:
        return
    saturated = unit is DriveUnit.PWM and high >= 0.98 * FULL_PWM
    what = "saturated: the drive is at its limit" if saturated else "one drive level only"
    level = f"{high:g} {unit.value}"
    if low < high:
        level = f"{low:g} ... {level} in 90 % of the rows"
    raise undetermined(
        f"{name}: {what} ({level}) whenever the motor is driven: gain and static friction "
        f"cannot be separated; {RECORD}"
    )


def no_model(name: str, segments: list[LogSegment]) -> ThumperError:
    """Return the error for a log whose speeds no model explains."""
    if coarse := _coarse_speeds(segments):
        return unusable(f"{name}: {coarse}")
    return unusable(f"{name}: the speed does not follow the drive; check columns, units and sign; {RECORD}")


def _coarse_speeds(segments: list[LogSegment]) -> str:
    """Return what is wrong with logged speeds of few values, and the fix; empty: they have many."""
    values = np.unique(np.round(np.abs(np.concatenate([s.speed_rad_s for s in segments])), 6))
    if segments[0].sensor_window_s is None or len(values) > MAX_COARSE_VALUES:
        return ""
    texts = ", ".join(f"{value:.3g}" for value in values)
    return (
        f"the speeds are too coarse: they have only the values {texts} rad/s, as one encoder count is "
        "a large speed over so short a time; log the counts, or speeds over a longer time"
    )


def check_model(name: str, fit: Fit, fit_percent: float, segments: list[LogSegment], unit: DriveUnit) -> None:
    """Reject a model that cannot be a motor's, or does not even describe the speeds that it is fitted to.

    Raises
    ------
    ThumperError
        The model is impossible, or does not describe the log.
    """
    check_percent(name, fit_percent, segments)
    friction = fit.model.friction
    largest_drive = max(float(np.abs(s.drive).max()) for s in segments)
    if friction < MIN_FRICTION_RATIO * largest_drive:
        raise unusable(
            f"{name}: the estimated static friction is {friction:.3g} {unit.value}: at high drive the "
            "speed hardly follows, it is clipped or limited; log the counts, or record at lower levels"
        )


def check_percent(name: str, fit_percent: float, segments: list[LogSegment], what: str = "speeds") -> None:
    """Reject a model that explains too little.

    Raises
    ------
    ThumperError
        The model does not describe the log.
    """
    if fit_percent < MIN_FIT_PERCENT:
        cause = _coarse_speeds(segments) or (
            f"check units, sign and that each row holds the drive applied until the next; else {RECORD}"
        )
        raise unusable(
            f"{name}: the model explains only {max(fit_percent, 0.0):.0f} % of the {what}: {cause}"
        )


def check_lag(name: str, fit: Fit, segments: list[LogSegment]) -> None:
    """Reject a fit whose lag changes the speeds less than the residuals, and hardly at all.

    On a ramp a lag acts like a larger friction: a static map, from drive to speed, predicts what the model
    does. Only the break-away differs, and stiction and ripple move that.

    Raises
    ------
    NoLagError
        The log shows gain and static friction alone.
    """
    speed = np.concatenate([s.speed_rad_s for s in segments])
    predicted = speed - fit.residual_rad_s
    clipped = np.concatenate([s.is_clipped for s in segments])
    use = (predicted != 0.0) & ~fit.is_glitch & ~clipped
    drive = np.concatenate([s.drive_at_windows() for s in segments])[use]
    X = np.column_stack((drive, predicted[use] > 0.0, predicted[use] < 0.0)).astype(float)
    gain, forward, backward = theta = np.linalg.lstsq(X, predicted[use], rcond=None)[0]
    by_lag = predicted[use] - X @ theta
    effect_rad_s = float(np.sqrt(np.mean(by_lag**2))) if by_lag.size else 0.0
    residual_rad_s = float(np.sqrt(np.mean(fit.residual_rad_s[~fit.is_glitch] ** 2)))
    if effect_rad_s < min(MIN_LAG_EFFECT * float(np.std(speed)), residual_rad_s):
        raise NoLagError(
            f"{name}: the drive changes too slowly to show time constant and delay: on a ramp they act like "
            f"friction; {RECORD}",
            fit,
            segments,
            (float(-forward / gain), float(backward / gain)),
        )


def check_determined(name: str, fit: Fit, unit: DriveUnit) -> None:
    """Reject a fit that its own uncertainty contradicts.

    Raises
    ------
    UndeterminedError
        A parameter is not determined.
    """
    model, std = fit.model, fit.uncertainty
    if fit.at_limit:
        raise undetermined(
            f"{name}: the log does not determine the {fit.at_limit}: the fit ends at its limit; "
            f"check the units, and that one clock stamps drive and speed; {RECORD}"
        )
    uncertain = _uncertain_parameter(model, std)
    if uncertain:
        raise undetermined(
            f"{name}: the log does not determine the {uncertain} (rad/s per {unit.value}); {RECORD}"
        )


def _uncertain_parameter(model: MotorModel, std: Uncertainty) -> str:
    if std.gain > MAX_RELATIVE_STD["gain"] * model.gain:
        return f"gain: {model.gain:.3g} +- {std.gain:.2g}"
    lag_s = model.time_constant_s + model.delay_s  # a log may determine only the sum: that gets a warning
    if std.time_constant_s > max(MAX_RELATIVE_STD["time_constant"] * lag_s, 0.004):
        return f"time constant: {model.time_constant_s:.3g} +- {std.time_constant_s:.2g} s"
    return ""
