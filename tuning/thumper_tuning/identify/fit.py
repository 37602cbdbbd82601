"""The output-error fit: soft-L1 loss between measured speeds and those of the simulated model."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.initial_guess import InitialGuess, era_time_constant_s, initial_guesses
from thumper_tuning.identify.least_squares import FitData, solve, weights
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.segments import LogSegment, thinned
from thumper_tuning.identify.sensor_window import with_window_spread
from thumper_tuning.logs.motor_log import BoolArray

GLITCH_SIGMAS = 8.0
BREAKAWAY_RATIOS = (1.0, 1.15, 1.3, 1.45, 1.6)
MAX_GUESSES = 3
REFITS = 2  # after which glitches and loss hardly change
START_WINDOWS_S = 0.05, 0.1, 0.2  # of filtered speeds, beside those of a row and of instantaneous speeds
SIGNIFICANT_DELAY_SIGMAS = 4.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A fitted model, its uncertainty, and its residuals."""

    model: MotorModel
    uncertainty: Uncertainty
    sensor_window_s: float | None  # averaging time of the logged speeds; None: of counts, over their windows
    at_limit: str  # the parameter that ends at a limit of the search and is not determined, or empty
    scale_rad_s: float  # robust standard deviation of the residuals
    cost: float  # mean absolute residual [rad/s]
    residual_rad_s: FloatArray  # all windows of all segments, shape (n,)
    is_glitch: BoolArray  # (n,)


def fit_motor(segments: list[LogSegment]) -> Fit | None:
    """Fit from the best initial guesses; None if no guess explains anything (the drive moves nothing).

    The guesses of a log of speeds have several sensor's windows; the fit then estimates the window.
    """
    data = FitData(segments=segments)
    few = FitData(segments=thinned(segments))
    starts = [few.with_sensor_window(window_s) for window_s in _start_windows_s(few)]
    era_s = era_time_constant_s(few.segments)
    guesses = [(guess, start.sensor_window_s) for start in starts for guess in initial_guesses(start, era_s)]
    guesses.sort(key=lambda found: found[0].residual_rad_s)
    found = [_improved(data.with_sensor_window(window_s), guess) for guess, window_s in guesses[:MAX_GUESSES]]
    return _refined(*min(found, key=lambda one: _cost(*one))) if found else None


def _start_windows_s(data: FitData) -> list[float | None]:
    row_s = data.sensor_window_s
    if row_s is None:
        return [None]
    return [0.0, row_s, *[window_s for window_s in START_WINDOWS_S if window_s > 1.5 * row_s]]


def residuals_of_refit(segments: list[LogSegment], fit: Fit, use: BoolArray) -> FloatArray:
    """Fit again, from a fit, to the windows that `use` marks; return all residuals, for cross-validation."""
    data = FitData(segments=segments).with_sensor_window(fit.sensor_window_s)
    found = solve(data, fit.model, use & ~fit.is_glitch, fit.scale_rad_s)
    return data.with_sensor_window(found.sensor_window_s).residuals(found.model)


def _improved(data: FitData, guess: InitialGuess) -> tuple[FitData, MotorModel]:
    """Fit all windows from a guess; return the data with the sensor's window, and the model."""
    scale = max(guess.residual_rad_s, 1e-9)
    found = solve(data, guess.model, np.ones(len(data.speed_rad_s), dtype=bool), scale)
    data = data.with_sensor_window(found.sensor_window_s)
    return data, _with_breakaway(data, found.model, scale)


def _refined(data: FitData, model: MotorModel) -> Fit:
    """Fit again without the glitches, with a loss that suits the residuals."""
    use, scale = _usable(data, data.residuals(model))
    for _ in range(REFITS):
        found = solve(data, model, use, scale)
        model, data = found.model, data.with_sensor_window(found.sensor_window_s)
        use, scale = _usable(data, data.residuals(model))
    found = solve(data, model, use, scale)
    uncertainty = found.uncertainty()
    if found.sensor_window_s is None and found.model.delay_s < SIGNIFICANT_DELAY_SIGMAS * uncertainty.delay_s:
        # The delay is not significant. Without it the other parameters are more certain.
        found = solve(data, replace(found.model, delay_s=0.0), use, scale, free_delay=False)
        uncertainty = replace(found.uncertainty(), delay_s=uncertainty.delay_s)
    model, data = found.model, data.with_sensor_window(found.sensor_window_s)
    uncertainty = with_window_spread(uncertainty, data, model, use, scale)
    residual = data.residuals(model)
    return Fit(
        model=model,
        uncertainty=uncertainty,
        sensor_window_s=found.sensor_window_s,
        at_limit=found.at_limit,
        scale_rad_s=scale,
        cost=_cost(data, model),
        residual_rad_s=residual,
        is_glitch=~use,
    )


def _cost(data: FitData, model: MotorModel) -> float:
    return float(np.mean(np.abs(data.residuals(model)) * weights(data.segments)))


def _usable(data: FitData, residual: FloatArray) -> tuple[BoolArray, float]:
    """Return the windows that are no glitches, and the residual where the loss turns linear [rad/s]."""
    quantum, std = _quantum(data.segments), _robust_std(data, residual)
    use = ~find_glitches(residual, max(GLITCH_SIGMAS * std, 3.0 * quantum))
    # Without the glitches, the remaining residuals are the model's own and no outliers. Nor is rounding
    # to whole counts: a loss that discounts residuals of one count is biased.
    return use, max(std, float(np.sqrt(np.mean(residual[use] ** 2))), 1.5 * quantum)


def _with_breakaway(data: FitData, model: MotorModel, scale_rad_s: float) -> MotorModel:
    """Choose the break-away ratio from a list: it decides on events, so the cost has no slope in it."""

    def cost(ratio: float) -> float:
        residual = data.residuals(replace(model, breakaway_ratio=ratio))
        return float(np.sum(np.sqrt(1.0 + (residual / scale_rad_s) ** 2)))

    best = min(BREAKAWAY_RATIOS, key=cost)
    return replace(model, breakaway_ratio=best if cost(best) < cost(1.0) - 1.0 else 1.0)


def _quantum(segments: list[LogSegment]) -> float:
    return max(s.quantum_rad_s for s in segments)


def _robust_std(data: FitData, residual: FloatArray) -> float:
    """Return the standard deviation in motion by the median [rad/s].

    It is never below that of rounding to counts, quantum / sqrt(6).
    """
    speed = np.abs(data.speed_rad_s)
    turning = speed > 0.05 * np.percentile(speed, 95)
    std = 1.4826 * float(np.median(np.abs(residual[turning])))
    return float(max(std, _quantum(data.segments) / np.sqrt(6.0), 1e-6))


def find_glitches(residual: FloatArray, limit: float) -> BoolArray:
    """Mark large residuals that are single or in pairs.

    Three or more of one sign in a row are a model error, not a glitch.
    """
    large = np.abs(residual) > limit
    sign = np.sign(residual) * large
    run_length = np.zeros(len(sign), dtype=int)  # of equal signs, at each residual
    edges = np.flatnonzero(np.diff(sign, prepend=np.nan))
    for first, last in itertools.pairwise([*edges.tolist(), len(sign)]):
        run_length[first:last] = last - first
    result: BoolArray = large & (run_length <= 2)
    return result
