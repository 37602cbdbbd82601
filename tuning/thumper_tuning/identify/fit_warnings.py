"""What a user should know of a fit that was accepted."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.cross_validation import Validation
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.segments import Segment
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.units import FULL_PWM

WHITENESS_LIMIT = 2.576  # 99 % of a normal distribution
LAGS = 20
NOT_WHITE = 0.6  # what a one-pole wheel with torque ripple stays below


def warnings_of(
    logs: list[MotorLog], stretches: list[Segment], fit: Fit, validation: Validation
) -> list[str]:
    """Sentences, most important first; empty for a good log."""
    found: list[str] = []
    model, std = fit.model, fit.uncertainty
    unit = logs[0].drive_unit.value
    period_s = float(np.median(np.concatenate([s.windows_s for s in stretches])))
    drive = np.concatenate([s.drive for s in stretches])
    speed = np.concatenate([s.speed_rad_s for s in stretches])
    if validation.fit_percent < 85.0:
        found.append(
            f"held-out speeds are predicted to {validation.fit_percent:.0f} % only: noise, play, slip, or a "
            "battery that sags (log its voltage as battery_V)"
        )
    glitches = int(fit.is_glitch.sum())
    if glitches:
        found.append(f"{glitches} of {len(speed)} speeds are glitches: left out")
    if fit.momentary:
        found.append("the speeds fit better as momentary ones than as means over the row's interval")
    if model.time_constant_s < 0.25 * period_s:
        found.append(
            f"the time constant is under a quarter of the rows' interval ({period_s:g} s): log faster to be "
            "sure"
        )
    if speed.min() > -0.02 * speed.max() or speed.max() < -0.02 * speed.min():
        found.append("one direction only: the other direction's friction is not known")
    if model.friction < -2.0 * std.friction:
        found.append(
            f"the static friction comes out negative ({model.friction:.2g} {unit}): the driver's voltage is "
            "no straight line of the command; take it as that line's offset"
        )
    elif np.abs(drive[drive != 0.0]).min() > 0.9 * max(
        model.friction_forward, model.friction_backward, 0.0
    ) and (std.friction > 0.25 * abs(model.friction)):
        found.append("the drive never came near the dead band: its width is extrapolated")
    if logs[0].drive_unit is DriveUnit.PWM and float(np.mean(np.abs(drive) >= FULL_PWM)) > 0.3:
        found.append("the drive is at its limit for more than 30 % of the log: smaller levels tell more")
    share = (
        max(log.quantum_rad for log in logs) / period_s / max(float(np.percentile(np.abs(speed), 90)), 1e-9)
    )
    if share > 0.1:
        found.append(
            f"one count is {100 * share:.0f} % of the usual speed: coarse; longer intervals would help"
        )
    if model.breakaway_ratio > 1.0:
        found.append(
            f"it takes {model.breakaway_ratio * model.friction:.3g} {unit} to break away, more than to keep "
            "going"
        )
    # Counting alone gives a negative correlation at lag 1: what one window lacks the next one has too much.
    if float(np.max(autocorrelation(validation.residual_rad_s[~fit.is_glitch]))) > NOT_WHITE:
        found.append(
            "the residuals are not white: there is more in this motor than one pole (play, sag, load)"
        )
    return found


def autocorrelation(residual: FloatArray, lags: int = LAGS) -> FloatArray:
    """Normalised autocorrelation at lags 1 ... `lags`."""
    centred = residual - residual.mean()
    power = float(centred @ centred) or 1.0
    return np.array(
        [float(centred[k:] @ centred[:-k]) / power for k in range(1, min(lags, len(residual) - 1) + 1)]
    )
