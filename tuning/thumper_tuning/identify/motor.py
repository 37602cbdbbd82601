"""Identify one motor from its logs: fit, validation, checks and warnings."""

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from thumper.common.errors import ThumperError
from thumper_tuning.identify.compare_models import ComparedModel, compare_models
from thumper_tuning.identify.cross_validation import Validation, cross_validate, fit_percent_of
from thumper_tuning.identify.excitation_checks import (
    check_determined,
    check_excitation,
    check_lag,
    check_model,
    check_percent,
    no_model,
    turns_one_way,
)
from thumper_tuning.identify.exponential_filter import FilteredModel, fit_filtered
from thumper_tuning.identify.fit import Fit, fit_motor
from thumper_tuning.identify.fit_warnings import filter_warnings, fit_warnings
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.richer_models import RicherModel, fit_richer_models, fit_second_order
from thumper_tuning.identify.saturation import with_ceiling
from thumper_tuning.identify.segments import (
    LogSegment,
    all_speeds,
    is_regular,
    split_segments,
    thinned,
    with_sensor_window,
)
from thumper_tuning.identify.stretches import fit_by_kind
from thumper_tuning.identify.systems import continuous_system, counted_system, friction_system
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.units import log_error

if TYPE_CHECKING:
    import control

COASTING_PERCENT = 3.0  # more of the held-out speeds is predicted without the rows in which the motor coasts
COASTING = "at 0 V the motor coasts, so the bridge opens there: these rows are left out"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IdentifiedMotor:
    """A motor's model, with the fit that it comes from."""

    name: str
    unit: DriveUnit
    model: MotorModel
    uncertainty: Uncertainty
    validation: Validation
    fit: Fit
    segments: tuple[LogSegment, ...]
    period_s: float
    supply_V: float | None
    warnings: tuple[str, ...]
    one_direction: bool = False  # the friction of the other direction is not determined
    columns: tuple[str, ...] = ()  # what was understood of the file
    fit_percent_by_kind: dict[str, float] = field(default_factory=dict)  # of held-out speeds, worst first

    @property
    def sensor_window_s(self) -> float:
        """The time over which the logged speeds are averaged; 0: instantaneous, or not logged but counted."""
        return self.fit.sensor_window_s or 0.0

    @property
    def friction_by_direction(self) -> dict[str, tuple[float, float] | None]:
        """Static friction and its standard deviation, forward and backward; None: not determined."""
        model, std = self.model, self.uncertainty
        found: dict[str, tuple[float, float] | None] = {
            "forward": (model.friction_forward, std.friction_forward),
            "backward": (model.friction_backward, std.friction_backward),
        }
        if self.one_direction:
            found["backward" if _turns_forward(self.segments) else "forward"] = None
        return found

    def continuous(self) -> "control.TransferFunction":
        """Return the motor as a continuous python-control system, from drive to speed, without friction."""
        return continuous_system(self.model)

    def counted(self, period_s: float) -> "control.TransferFunction":
        """Return the exact discrete system, from drive to the speed that a board counts per period."""
        return counted_system(self.model, period_s)

    def with_friction(self, period_s: float) -> "control.NonlinearIOSystem":
        """Return the discrete nonlinear system with friction, for `control.input_output_response`."""
        return friction_system(self.model, period_s)

    def second_order(self) -> RicherModel:
        """Return the second-order grey box (thesis, eq. 3.3, with friction), fitted to the same data."""
        return fit_second_order(*self.rows_of_richer_models())

    def compare(self, *, backlash: bool = False) -> list[ComparedModel]:
        """Return models of this motor with their validation fit; `backlash` adds that grey box (seconds)."""
        segments, fit = self.rows_of_richer_models()
        return compare_models(
            segments,
            fit,
            self.validation.fit_percent,
            fit_richer_models(segments, fit, backlash=backlash),
            self.period_s,
        )

    def rows_of_richer_models(self) -> tuple[list[LogSegment], Fit]:
        """Return the rows that the richer models are fitted to: they are simulated in small steps."""
        ends = np.cumsum([len(s.speed_rad_s) for s in self.segments])
        numbered = [
            replace(s, speed_rad_s=np.arange(end - len(s.speed_rad_s), end, dtype=float))
            for s, end in zip(self.segments, ends, strict=True)
        ]
        rows = all_speeds(thinned(numbered)).astype(int)
        fit = replace(
            self.fit, residual_rad_s=self.fit.residual_rad_s[rows], is_glitch=self.fit.is_glitch[rows]
        )
        return thinned(list(self.segments)), fit


def identify(logs: list[MotorLog]) -> IdentifiedMotor:
    """Identify one motor from one or several runs.

    A log in volts does not say whether 0 V brakes the motor or opens the bridge: what predicts better counts.

    Raises
    ------
    UndeterminedError
        The logs determine a part of the model; `identify_partly` finds it.
    ThumperError
        The logs determine nothing; the message says why and what to record.
    """
    if logs[0].drive_unit is DriveUnit.PWM:
        return _identify(logs)
    least_percent, found, refusal = 0.0, None, None
    try:
        found = _identify(logs)
        least_percent = found.validation.fit_percent + COASTING_PERCENT
    except ThumperError as error:
        refusal = error
    if least_percent < 100.0:
        with suppress(ThumperError):
            coasting = _identify([replace(log, opens_at_zero=True) for log in logs])
            if coasting.validation.fit_percent > least_percent:
                return replace(coasting, warnings=(*coasting.warnings, COASTING))
    if refusal is not None:
        raise refusal
    assert found is not None
    return found


def _identify(logs: list[MotorLog]) -> IdentifiedMotor:
    """Identify one motor, with what its logs say about 0 V."""
    name = logs[0].name
    segments, reversed_sign = signed_segments(logs)
    check_excitation(logs, segments)
    one_direction = turns_one_way(segments)
    fit = _best_fit(segments)
    if fit is None:
        raise no_model(name, segments)
    segments = with_sensor_window(segments, fit.sensor_window_s)
    if one_direction:
        fit = _one_sided(fit, segments)
    unit = logs[0].drive_unit
    check_model(name, fit, fit_percent_of(segments, fit), segments, unit)
    check_lag(name, fit, segments)
    validation = cross_validate(segments, fit)
    check_percent(name, validation.fit_percent, segments, "held-out speeds")
    check_determined(name, fit, unit)
    warnings = list(dict.fromkeys(warning for log in logs for warning in log.warnings))
    if reversed_sign:
        warnings.append(
            "the speed falls when the drive rises: encoder or motor is connected the other way round; "
            "its sign was inverted"
        )
    if one_direction:
        other = "backward" if _turns_forward(segments) else "forward"
        warnings.append(f"one direction only: the {other} friction is not determined")
    by_kind = fit_by_kind(segments, fit, validation)
    filtered = fit_filtered(segments, fit)
    warnings += fit_warnings(logs, segments, fit, validation, by_kind)
    warnings += filter_warnings(fit, filtered)
    supplies = [log.supply_V for log in logs if log.supply_V is not None]
    return IdentifiedMotor(
        name=name,
        unit=unit,
        model=fit.model,
        uncertainty=_with_filter(_with_hidden_delay(fit), fit, filtered),
        validation=validation,
        fit=fit,
        segments=tuple(segments),
        period_s=round(float(np.median([log.period_s for log in logs])), 9),  # control compares them exactly
        supply_V=float(np.mean(supplies)) if supplies else None,
        warnings=tuple(warnings),
        one_direction=one_direction,
        columns=logs[0].columns,
        fit_percent_by_kind=by_kind,
    )


def signed_segments(logs: list[MotorLog]) -> tuple[list[LogSegment], bool]:
    """Return the segments of all runs, with the speed in the drive's direction, and whether it was not.

    Raises
    ------
    ThumperError
        The files differ in their columns.
    """
    if len({(log.drive_unit, log.position_rad is None) for log in logs}) > 1:
        raise log_error(
            f"{logs[0].name}: the files differ in their columns (PWM or voltage, counts or speed)"
        )
    segments = [segment for log in logs for segment in split_segments(log)]
    if logs[0].position_rad is None:  # counts cannot be clipped
        segments = with_ceiling(segments)
    if not _is_reversed(segments):
        return segments, False
    return [replace(s, speed_rad_s=-s.speed_rad_s) for s in segments], True


def _with_hidden_delay(fit: Fit) -> Uncertainty:
    """Add the delay's uncertainty to the time constant's if the delay is not significant.

    A delay that small is part of the fitted time constant.
    """
    std = fit.uncertainty
    if fit.model.delay_s > 0.0 or fit.sensor_window_s is not None:
        return std
    return replace(std, time_constant_s=math.hypot(std.time_constant_s, std.delay_s))


def _with_filter(std: Uncertainty, fit: Fit, filtered: list[FilteredModel]) -> Uncertainty:
    """Add how far the time constant would be from that of a motor behind a low-pass."""
    tau_s = fit.model.time_constant_s
    error_s = max((abs(one.model.time_constant_s - tau_s) for one in filtered), default=0.0)
    return replace(std, time_constant_s=math.hypot(std.time_constant_s, error_s))


def _best_fit(segments: list[LogSegment]) -> Fit | None:
    """Return the fit; of irregular rows of speeds, that which reads them better.

    Each speed is the mean over one time, the sensor's window, or over its own row's interval.
    """
    fit = fit_motor(segments)
    if fit is None or fit.sensor_window_s is None or is_regular(segments):
        return fit
    over_rows = fit_motor(with_sensor_window(segments, None))
    return fit if over_rows is None or fit.cost <= over_rows.cost else over_rows


def _one_sided(fit: Fit, segments: list[LogSegment]) -> Fit:
    """Give the direction that was not driven the friction of the other, as simulations need one."""
    std = fit.uncertainty
    if _turns_forward(segments):
        friction, friction_std = fit.model.friction_forward, std.friction_forward
    else:
        friction, friction_std = fit.model.friction_backward, std.friction_backward
    return replace(
        fit,
        model=replace(fit.model, friction_forward=friction, friction_backward=friction),
        uncertainty=replace(
            std, friction=friction_std, friction_forward=friction_std, friction_backward=friction_std
        ),
    )


def _turns_forward(segments: Iterable[LogSegment]) -> bool:
    return sum(float(s.speed_rad_s.sum()) for s in segments) > 0.0


def _is_reversed(segments: list[LogSegment]) -> bool:
    """Return whether the speed has the opposite sign of the drive."""
    total = 0.0
    for s in segments:
        limit = 3.0 * float(np.median(np.abs(s.speed_rad_s))) + 1e-9
        total += float(np.sum(s.drive_at_windows() * np.clip(s.speed_rad_s, -limit, limit)))
    return total < 0.0
