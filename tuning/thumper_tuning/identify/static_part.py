"""Slow ramps: they show gain and static friction, but no lag."""

import math
from dataclasses import replace

import numpy as np

from thumper_tuning.identify.cross_validation import fit_percent_of
from thumper_tuning.identify.excitation_checks import NoLagError, turns_one_way
from thumper_tuning.identify.partial_motor import RECORD_NEXT, PartialMotor, why_partly
from thumper_tuning.identify.segments import LogSegment
from thumper_tuning.identify.sensor_window import UNIFORM_STD
from thumper_tuning.logs.motor_log import MotorLog

ASSUMED_LAG_S = 0.2  # time constant plus delay, at most: of most geared motors it is less


def identify_static_part(logs: list[MotorLog], reason: NoLagError) -> PartialMotor:
    """Return gain and static friction of slow ramps.

    A ramp shows only friction plus rate times lag. The friction is that without a lag of half of
    `ASSUMED_LAG_S`, and its standard deviation includes any lag up to all of it.
    """
    name, unit, fit = logs[0].name, logs[0].drive_unit, reason.fit
    rate = _ramp_rate(reason.segments)
    by_lag = 0.5 * rate * ASSUMED_LAG_S
    frictions = reason.frictions[0] - by_lag, reason.frictions[1] - by_lag
    not_determined = ["time_constant_s", "delay_s"]
    warnings = [warning for log in logs for warning in log.warnings]
    if turns_one_way(reason.segments):
        forward = sum(float(s.speed_rad_s.sum()) for s in reason.segments) > 0.0
        frictions = (frictions[0 if forward else 1],) * 2
        not_determined.append(f"static_friction_{'backward' if forward else 'forward'}_{unit.value}")
    warnings.append(
        f"the drive changes by {rate:.3g} {unit.value} per s: static friction is that of a time constant "
        f"plus delay of 0 to {1e3 * ASSUMED_LAG_S:.0f} ms"
    )
    return PartialMotor(
        name=name,
        unit=unit,
        model=replace(fit.model, friction_forward=frictions[0], friction_backward=frictions[1]),
        time_constant_std_s=math.inf,
        delay_std_s=math.inf,
        period_s=round(float(np.median([log.period_s for log in logs])), 9),
        steady=(),
        fit_percent=fit_percent_of(reason.segments, fit),
        warnings=tuple(warnings),
        not_determined=tuple(not_determined),
        reason=why_partly(reason, name),
        record_next=RECORD_NEXT,
        columns=logs[0].columns,
        static=replace(fit.uncertainty, friction=by_lag * UNIFORM_STD),
    )


def _ramp_rate(segments: list[LogSegment]) -> float:
    """Return the mean rate of the drive while the motor turns [drive unit per s]."""
    change = [np.abs(np.diff(s.drive_at_windows()))[s.speed_rad_s[1:] != 0.0] for s in segments]
    lasts_s = [s.windows_s[1:][s.speed_rad_s[1:] != 0.0] for s in segments]
    return float(np.concatenate(change).sum() / max(np.concatenate(lasts_s).sum(), 1e-9))
