"""From logs of one motor to what is known of it: the whole way, with every refusal and warning."""

import math
from dataclasses import dataclass, replace

import numpy as np

from thumper_tuning.identify.cross_validation import Validation, cross_validate
from thumper_tuning.identify.excitation_checks import RECORD, check_after, check_before
from thumper_tuning.identify.fit import Fit, fit_motor
from thumper_tuning.identify.fit_warnings import warnings_of
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.segments import Segment, cut
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.units import refusal

MOMENTARY_GAIN = 0.97  # a log of speeds is taken for momentary ones only if they fit this much better


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identified:
    """A motor's model with what it rests on."""

    name: str
    unit: DriveUnit
    model: MotorModel
    uncertainty: Uncertainty
    validation: Validation
    fit: Fit
    stretches: tuple[Segment, ...]
    period_s: float
    supply_V: float | None
    warnings: tuple[str, ...]


def identify(logs: list[MotorLog], *, one_direction: bool = False) -> Identified:
    """Identify one motor from one or several runs.

    Raises
    ------
    ThumperError
        The logs cannot support an answer; the message says why and what to record.
    """
    name = logs[0].name
    if len({(log.drive_unit, log.position_rad is None) for log in logs}) > 1:
        raise refusal(f"{name}: the files differ in what they hold (PWM or voltage, counts or speed)")
    stretches = [stretch for log in logs for stretch in cut(log)]
    flipped = _falls_forward(stretches)
    if flipped:
        stretches = [replace(s, speed_rad_s=-s.speed_rad_s) for s in stretches]
    check_before(logs, stretches, one_direction=one_direction)
    fit = _best_fit(logs, stretches)
    if fit is None:
        raise refusal(f"{name}: the speed does not follow the drive; check columns, units and sign; {RECORD}")
    if one_direction:
        fit = replace(fit, model=_one_sided(fit.model, stretches))
    validation = cross_validate(stretches, fit)
    largest = max(float(np.abs(s.drive).max()) for s in stretches)
    check_after(name, fit, validation.fit_percent, logs[0].drive_unit, largest)
    notes = list(dict.fromkeys(note for log in logs for note in log.warnings))
    if flipped:
        notes.append(
            "the speed falls when the drive rises: encoder or motor is connected the other way round; "
            "its sign was turned"
        )
    notes += warnings_of(logs, stretches, fit, validation)
    supplies = [log.supply_V for log in logs if log.supply_V is not None]
    return Identified(
        name=name,
        unit=logs[0].drive_unit,
        model=fit.model,
        uncertainty=_with_hidden_delay(fit),
        validation=validation,
        fit=fit,
        stretches=tuple(stretches),
        period_s=float(np.median([log.period_s for log in logs])),
        supply_V=float(np.mean(supplies)) if supplies else None,
        warnings=tuple(notes),
    )


def _with_hidden_delay(fit: Fit) -> Uncertainty:
    """A delay too small to be told from none hides in the time constant, which is no surer than it."""
    std = fit.uncertainty
    if fit.model.delay_s > 0.0:
        return std
    return replace(std, time_constant_s=math.hypot(std.time_constant_s, std.delay_s))


def _best_fit(logs: list[MotorLog], stretches: list[Segment]) -> Fit | None:
    mean = fit_motor(stretches, momentary=False)
    if logs[0].position_rad is not None:
        return mean
    momentary = fit_motor(stretches, momentary=True)
    if mean is None or momentary is None:
        return mean or momentary
    return momentary if momentary.cost < MOMENTARY_GAIN * mean.cost else mean


def _one_sided(model: MotorModel, stretches: list[Segment]) -> MotorModel:
    """What one direction tells is all that is known: the other gets the same friction."""
    forward = sum(float(s.speed_rad_s.sum()) for s in stretches) > 0.0
    seen = model.friction_forward if forward else model.friction_backward
    return replace(model, friction_forward=seen, friction_backward=seen)


def _falls_forward(stretches: list[Segment]) -> bool:
    """Whether the speed runs against the drive, judged by the drive of the window and of the one before."""
    total = 0.0
    for s in stretches:
        at = np.clip(np.searchsorted(s.change_s, s.edge_s[:-1] + 1e-9, side="right") - 1, 0, None)
        drive, limit = s.drive[at], 3.0 * float(np.median(np.abs(s.speed_rad_s))) + 1e-9
        total += float(np.sum(drive * np.clip(s.speed_rad_s, -limit, limit)))
    return total < 0.0
