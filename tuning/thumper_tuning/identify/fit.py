"""The output-error fit: soft-L1 between what was counted and what the model would have had counted."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.initial_guess import InitialGuess, starts
from thumper_tuning.identify.least_squares import residuals, solve, weights
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.segments import Segment
from thumper_tuning.logs.motor_log import BoolArray

GLITCH_SIGMAS = 8.0
BREAKAWAY_RATIOS = (1.0, 1.15, 1.3, 1.45, 1.6)
STARTS_TRIED = 3
SURE_DELAY_SIGMAS = 4.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A fitted model, how sure it is, and what it leaves unexplained."""

    model: MotorModel
    uncertainty: Uncertainty
    momentary: bool  # the log holds momentary speeds, not means over the row's interval
    scale_rad_s: float  # robust standard deviation of the residuals
    cost: float  # mean absolute residual [rad/s]
    residual_rad_s: FloatArray  # all windows of all stretches, shape (n,)
    is_glitch: BoolArray  # (n,)


def fit_motor(stretches: list[Segment], *, momentary: bool) -> Fit | None:
    """Fit from the best starts; None when no start explains anything (the drive moves nothing)."""
    tried = starts(stretches, momentary=momentary)[:STARTS_TRIED]
    fits = [_improve(stretches, start, momentary) for start in tried]
    return min(fits, key=lambda fit: fit.cost) if fits else None


def refit(stretches: list[Segment], fit: Fit, use: BoolArray) -> MotorModel:
    """Fit again from a fit's model to the windows that `use` marks: for validation on the others."""
    return solve(stretches, fit.model, use & ~fit.is_glitch, fit.scale_rad_s, fit.momentary)[0]


def _improve(stretches: list[Segment], start: InitialGuess, momentary: bool) -> Fit:
    everything = np.ones(sum(len(s.speed_rad_s) for s in stretches), dtype=bool)
    model, scale = start.model, max(start.misfit, 1e-9)
    use = everything
    for round_ in range(3):
        model, _ = solve(stretches, model, use, scale, momentary)
        if round_ == 0:
            model = _with_breakaway(stretches, model, scale, momentary)
        residual = residuals(stretches, model, momentary=momentary)
        spread = _spread(stretches, residual)
        use = ~_glitches(residual, max(GLITCH_SIGMAS * spread, 3.0 * _quantum(stretches)))
        # Once glitches are out, what is left is the model's own: it must not be taken for outliers.
        # Nor may counting: a loss that doubts residuals of one count is biased, as they come in whole counts.
        scale = max(spread, float(np.sqrt(np.mean(residual[use] ** 2))), 1.5 * _quantum(stretches))
    model, uncertainty = solve(stretches, model, use, scale, momentary)
    if model.delay_s < SURE_DELAY_SIGMAS * uncertainty.delay_s:
        # No delay that could be told from none: without it the others are surer.
        delay_std_s = uncertainty.delay_s
        still = replace(model, delay_s=0.0)
        model, uncertainty = solve(stretches, still, use, scale, momentary, free_delay=False)
        uncertainty = replace(uncertainty, delay_s=delay_std_s)
    residual = residuals(stretches, model, momentary=momentary)
    return Fit(
        model=model,
        uncertainty=uncertainty,
        momentary=momentary,
        scale_rad_s=scale,
        cost=float(np.mean(np.abs(residual) * weights(stretches))),
        residual_rad_s=residual,
        is_glitch=~use,
    )


def _with_breakaway(stretches: list[Segment], model: MotorModel, scale: float, momentary: bool) -> MotorModel:
    """The break-away friction is an event, not a slope: try a few."""

    def misfit(ratio: float) -> float:
        tried = replace(model, breakaway_ratio=ratio)
        return float(np.sum(np.sqrt(1.0 + (residuals(stretches, tried, momentary=momentary) / scale) ** 2)))

    best = min(BREAKAWAY_RATIOS, key=misfit)
    return replace(model, breakaway_ratio=best if misfit(best) < misfit(1.0) - 1.0 else 1.0)


def _quantum(stretches: list[Segment]) -> float:
    return max(s.quantum_rad_s for s in stretches)


def _spread(stretches: list[Segment], residual: FloatArray) -> float:
    """Standard deviation of the bulk while it turns [rad/s]; never below that of counting, quantum /
    sqrt(6)."""
    speed = np.abs(np.concatenate([s.speed_rad_s for s in stretches]))
    turning = speed > 0.05 * np.percentile(speed, 95)
    bulk = 1.4826 * float(np.median(np.abs(residual[turning])))
    return float(max(bulk, _quantum(stretches) / np.sqrt(6.0), 1e-6))


def _glitches(residual: FloatArray, limit: float) -> BoolArray:
    """Large residuals that stand alone or in a pair. Three of one sign in a row are a wrong model, no
    glitch."""
    far = np.abs(residual) > limit
    sign = np.sign(residual) * far
    run = np.zeros(len(sign), dtype=int)  # length of the run of one sign that each residual belongs to
    edges = np.flatnonzero(np.diff(sign, prepend=np.nan))
    for first, last in itertools.pairwise([*edges.tolist(), len(sign)]):
        run[first:last] = last - first
    result: BoolArray = far & (run <= 2)
    return result
