"""What a log shows that does not determine the whole model: one level, one step, a short run.

Gain and static friction need two levels. One level shows the time constant, the delay, and the speed that it
leads to. The model is then linear, from the drive to that speed.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.covariance import correlated_lags, jacobian, sandwich_covariance
from thumper_tuning.identify.cross_validation import fit_percent
from thumper_tuning.identify.excitation_checks import NoLagError, UndeterminedError
from thumper_tuning.identify.fit import GLITCH_SIGMAS, SIGNIFICANT_DELAY_SIGMAS, find_glitches
from thumper_tuning.identify.initial_guess import TIME_CONSTANTS_S, delays_s
from thumper_tuning.identify.least_squares import FitData, longest_periods, minimize_soft_l1, weights
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor import signed_segments
from thumper_tuning.identify.partial_motor import RECORD_NEXT, PartialMotor, SteadySpeed, why_partly
from thumper_tuning.identify.segments import LogSegment, median_window_s
from thumper_tuning.identify.sensor_window import UNIFORM_STD
from thumper_tuning.identify.static_part import identify_static_part
from thumper_tuning.logs.motor_log import BoolArray, MotorLog

if TYPE_CHECKING:
    pass

MIN_FIT_PERCENT = 60.0
SETTLED_TIME_CONSTANTS = 4.0
MAX_RELATIVE_STD = 0.5
MAX_FRICTION_STD = 0.2  # of several levels: a larger share says that the log shows friction, not lag
SAME_LEVEL = 0.03
SEVERAL = 0.2  # of the largest drive: the levels differ by more than noise and a controller's ripple
SEVERAL_LEVELS = "the drive has several levels"
ASSUMED_FRICTION = 0.15  # of the drive: the share that a small geared motor loses at a half to full drive


def identify_partly(logs: list[MotorLog], reason: UndeterminedError) -> PartialMotor:
    """Return what the logs determine.

    Raises
    ------
    UndeterminedError
        `reason`: the logs determine nothing.
    """
    if isinstance(reason, NoLagError):
        return identify_static_part(logs, reason)
    name, unit = logs[0].name, logs[0].drive_unit
    segments, _ = signed_segments(logs)
    data = FitData(segments=segments)
    # So little data does not show a sensor's window: a speed is a mean over up to a row's interval.
    windows_s = {data.sensor_window_s, 0.0} if data.sensor_window_s is not None else {None}
    fits = {window_s: _fit(data.with_sensor_window(window_s)) for window_s in windows_s}
    window_s = min(fits, key=lambda w: fits[w].cost)
    best = fits[window_s]
    model, std = best.model, best.std
    spread = UNIFORM_STD * np.ptp([(f.model.time_constant_s, f.model.delay_s) for f in fits.values()], axis=0)
    cause, friction_s, friction_delay_s = _effect_of_friction_s(data.with_sensor_window(window_s), best)
    time_constant_std_s = math.hypot(model.time_constant_s * float(std[1]), friction_s, float(spread[0]))
    if (
        best.fit_percent < MIN_FIT_PERCENT
        or not 0.0 < std[1] <= MAX_RELATIVE_STD
        or (cause == SEVERAL_LEVELS and time_constant_std_s > MAX_FRICTION_STD * model.time_constant_s)
    ):
        raise reason
    warnings = [warning for log in logs for warning in log.warnings]
    if any(log.has_setpoint for log in logs):
        warnings.append(
            "recorded in closed loop: feedback can bias the time constant; record open-loop steps to check"
        )
    if glitches := best.glitches(segments):
        warnings.append(glitches)
    if friction_s > 0.0:
        warnings.append(
            f"{cause}: a friction of {100 * ASSUMED_FRICTION:.0f} % of it would "
            f"change the time constant by {1e3 * friction_s:.0f} ms; this is a part of its standard deviation"
        )
    not_determined = [f"gain_rad_s_per_{unit.value}", f"static_friction_{unit.value}"]
    if math.isinf(std[2]):
        not_determined.append("delay_s")
    return PartialMotor(
        name=name,
        unit=unit,
        model=model,
        time_constant_std_s=time_constant_std_s,
        delay_std_s=math.hypot(float(std[2]) * median_window_s(segments), friction_delay_s, float(spread[1])),
        period_s=round(float(np.median([log.period_s for log in logs])), 9),
        steady=tuple(_steady_speeds(segments, model, best.use)),
        fit_percent=best.fit_percent,
        warnings=tuple(warnings),
        not_determined=tuple(not_determined),
        reason=why_partly(reason, name),
        record_next=RECORD_NEXT,
        columns=logs[0].columns,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LinearFit:
    model: MotorModel
    std: FloatArray  # of ln gain, ln tau, delay in windows; inf: not determined
    use: BoolArray  # no glitch
    cost: float
    fit_percent: float

    def glitches(self, segments: list[LogSegment]) -> str:
        """Return the warning that names the glitches, or an empty string."""
        at = np.flatnonzero(~self.use)
        if not at.size:
            return ""
        ends_s = np.concatenate([s.edge_s[1:] for s in segments])[at]
        speeds = np.concatenate([s.speed_rad_s for s in segments])[at]
        some = ", ".join(f"{y:.3g} rad/s at {t:.2f} s" for t, y in zip(ends_s[:4], speeds[:4], strict=True))
        return f"{at.size} of {len(self.use)} speeds are glitches: left out ({some})"


def _fit(data: FitData) -> _LinearFit:
    """Fit gain, time constant and delay without friction; leave out glitches and a delay near zero."""
    problem = _Problem(data=data, start=_initial(data))
    use = np.ones(len(data.speed_rad_s), dtype=bool)
    x = np.array([0.0, 0.0, problem.start.delay_s / data.period_s])
    residual = data.residuals(problem.start)
    scale = problem.scale(residual, use)
    for _ in range(3):
        x = problem.solve(x, use, scale)
        residual = data.residuals(problem.model(x))
        robust = 1.4826 * float(np.median(np.abs(residual[problem.moving])))
        use = ~find_glitches(residual, max(GLITCH_SIGMAS * robust, problem.least_glitch_rad_s))
        scale = problem.scale(residual, use)
    std = problem.std(x, use, scale)
    # At its upper bound, or without effect (the drive never changes), the delay is not determined.
    constant = all((s.drive == s.initial_drive).all() for s in data.segments)
    bounded = constant or std[2] <= 0.0 or x[2] > problem.bounds(3)[1][2] - 1e-3
    if bounded or x[2] < SIGNIFICANT_DELAY_SIGMAS * std[2]:
        delay_std = math.inf if bounded else float(std[2])
        x = problem.solve(x[:2], use, scale)
        std = np.append(problem.std(x, use, scale), delay_std)
    if abs(x[1]) > problem.bounds(3)[1][1] - 1e-3:
        std[1] = math.inf  # the time constant is at a bound
    model = problem.model(x)
    residual = data.residuals(model)
    counted = use & (problem.weight > 0.0)
    return _LinearFit(
        model=model,
        std=std,
        use=use,
        cost=float(np.mean(np.abs(residual))),
        fit_percent=fit_percent(data.speed_rad_s[counted], residual[counted]),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Least squares over ln gain, ln tau, and the delay in windows; without the third it is zero."""

    data: FitData
    start: MotorModel

    @property
    def weight(self) -> FloatArray:
        return weights(self.data.segments)

    @property
    def moving(self) -> BoolArray:
        speed = np.abs(self.data.speed_rad_s)
        return np.asarray(speed > 0.05 * np.percentile(speed, 95))

    @property
    def quantum_rad_s(self) -> float:
        return max(s.quantum_rad_s for s in self.data.segments)

    @property
    def least_glitch_rad_s(self) -> float:
        """Three counts, and a tenth of the speed: a quiet log has a median residual near zero."""
        return max(3.0 * self.quantum_rad_s, 0.1 * float(np.percentile(np.abs(self.data.speed_rad_s), 95)))

    def scale(self, residual: FloatArray, use: BoolArray) -> float:
        """Return the residual where the loss turns linear: as in `fit`, not below 1.5 counts."""
        return max(float(np.sqrt(np.mean(residual[use] ** 2))), 1.5 * self.quantum_rad_s, 1e-6)

    def model(self, x: FloatArray) -> MotorModel:
        return replace(
            self.start,
            gain=self.start.gain * float(np.exp(x[0])),
            time_constant_s=self.start.time_constant_s * float(np.exp(x[1])),
            delay_s=float(x[2]) * self.data.period_s if len(x) > 2 else 0.0,
        )

    def bounds(self, count: int) -> tuple[list[float], list[float]]:
        high = [1.0, 6.0, longest_periods(self.data.period_s)]
        return [-1.0, -6.0, 0.0][:count], high[:count]

    def residuals(self, x: FloatArray, use: BoolArray, scale: float) -> FloatArray:
        return (self.data.residuals(self.model(x)) * self.weight)[use] / scale

    def solve(self, x: FloatArray, use: BoolArray, scale: float) -> FloatArray:
        return minimize_soft_l1(
            partial(self.residuals, use=use, scale=scale),
            x.tolist(),
            self.bounds(len(x)),
            [0.1, 0.2, 0.2],
            diff_step=1e-4,
            max_nfev=60,
        )

    def std(self, x: FloatArray, use: BoolArray, scale: float) -> FloatArray:
        low, high = self.bounds(len(x))
        lags = correlated_lags(self.data.period_s)
        J = jacobian(partial(self.residuals, use=use, scale=scale), x, np.array(low), np.array(high))
        found: FloatArray = np.sqrt(np.diag(sandwich_covariance(J, self.residuals(x, use, scale), lags)))
        return found


def _initial(data: FitData) -> MotorModel:
    """Return the best model of a grid of time constants and delays; the gain follows by least squares."""
    y = data.speed_rad_s
    plausible = np.abs(y) <= 1.25 * np.percentile(np.abs(y), 90)
    plausible &= ~np.concatenate([s.is_clipped for s in data.segments])
    data = replace(data, segments=[replace(s, ceiling_rad_s=np.inf) for s in data.segments])
    best, best_cost = None, np.inf
    for delay_s in delays_s(data.period_s):
        for tau_s in TIME_CONSTANTS_S:
            unit = MotorModel(
                gain=1.0,
                time_constant_s=float(tau_s),
                friction_forward=0.0,
                friction_backward=0.0,
                delay_s=delay_s,
            )
            predicted = y - data.residuals(unit)
            power = float(predicted[plausible] @ predicted[plausible])
            gain = float(predicted[plausible] @ y[plausible]) / power if power > 0.0 else 0.0
            cost = float(np.sum(np.abs(y - gain * predicted)[plausible]))
            if gain > 0.0 and cost < best_cost:
                best, best_cost = replace(unit, gain=gain), cost
    return best or MotorModel(gain=1e-9, time_constant_s=0.1, friction_forward=0.0, friction_backward=0.0)


def _effect_of_friction_s(data: FitData, fit: _LinearFit) -> tuple[str, float, float]:
    """Return why a friction matters, and how far it would change time constant and delay [s].

    Friction slows a wheel down before a reversal and holds it back after it. In a ramp it looks like a lag.
    In a step from rest it only scales the speed, so it does not matter there.
    """
    drive = np.abs(np.concatenate([s.drive for s in data.segments]))
    driven = drive[drive > 0.0]
    if any((s.drive[1:] * s.drive[:-1] < 0.0).any() for s in data.segments):
        cause = "the drive reverses without a rest"
    elif driven.size and np.ptp(np.percentile(driven, (10, 90))) > SEVERAL * driven.max():
        cause = SEVERAL_LEVELS
    else:
        return "", 0.0, 0.0
    friction = ASSUMED_FRICTION * max(float(np.abs(s.drive).max()) for s in data.segments)
    start = replace(
        fit.model,
        gain=fit.model.gain / (1.0 - ASSUMED_FRICTION),
        friction_forward=friction,
        friction_backward=friction,
    )
    problem = _Problem(data=data, start=start)
    x = problem.solve(
        np.array([0.0, 0.0, start.delay_s / data.period_s]),
        fit.use,
        problem.scale(data.residuals(start), fit.use),
    )
    other = problem.model(x)
    return (
        cause,
        abs(other.time_constant_s - fit.model.time_constant_s),
        abs(other.delay_s - fit.model.delay_s),
    )


def _steady_speeds(segments: list[LogSegment], model: MotorModel, use: BoolArray) -> list[SteadySpeed]:
    """Return the mean speed of each level after it held for the delay and four time constants.

    Levels of one sign that follow each other closely, as those of a controller, are one: their mean.
    """
    settling_s = model.delay_s + SETTLED_TIME_CONSTANTS * model.time_constant_s
    found: list[FloatArray] = []  # drive and speed, shape (2, n) each
    first = 0
    for s in segments:
        kept = use[first : first + len(s.speed_rad_s)]
        first += len(s.speed_rad_s)
        drive = s.drive_at_windows()
        changes = np.concatenate(([True], np.abs(np.diff(drive)) > SAME_LEVEL * np.abs(drive).max()))
        start_s = s.edge_s[:-1][np.maximum.accumulate(np.where(changes, np.arange(len(drive)), 0))]
        settled = kept & (s.edge_s[1:] - start_s > settling_s) & (drive != 0.0)
        found.append(np.stack((drive[settled], s.speed_rad_s[settled])))
    drive, speed = np.concatenate(found, axis=1)
    order = np.argsort(drive, kind="stable")
    drive, speed = drive[order], speed[order]
    apart = np.diff(drive) > SAME_LEVEL * np.abs(drive).max(initial=0.0)
    edges = np.flatnonzero(apart | (np.diff(np.sign(drive)) != 0.0)) + 1
    return [
        SteadySpeed(drive=float(np.mean(u)), speed_rad_s=float(np.mean(y)), std_rad_s=float(np.std(y)))
        for u, y in zip(np.split(drive, edges), np.split(speed, edges), strict=True)
        if len(y) >= 3
    ]
