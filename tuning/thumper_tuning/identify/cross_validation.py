"""Cross-validation: how well the model predicts the parts of the log that it was not fitted to."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.fit import Fit, residuals_of_refit
from thumper_tuning.identify.least_squares import are_shown
from thumper_tuning.identify.segments import LogSegment, all_speeds
from thumper_tuning.logs.motor_log import BoolArray

BLOCKS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Validation:
    """Held-out residuals of all windows, and the fit in percent."""

    fit_percent: float
    residual_rad_s: FloatArray


def cross_validate(segments: list[LogSegment], fit: Fit) -> Validation:
    """Hold out each tenth of the log in turn, fit the rest, and predict it.

    The prediction uses only the drive from the start of each segment on. Glitches are not counted.
    """
    return validate(segments, fit, lambda use: residuals_of_refit(segments, fit, use))


def validate(
    segments: list[LogSegment], fit: Fit, residuals_of_fit_to: Callable[[BoolArray], FloatArray]
) -> Validation:
    """Collect held-out residuals; the function fits to the marked windows and returns all residuals."""
    blocks = _blocks(segments)
    held_out = np.zeros(len(blocks))
    for block in np.unique(blocks):
        out = blocks == block
        held_out[out] = residuals_of_fit_to(~out)[out]
    return Validation(
        fit_percent=fit_percent_of(segments, replace(fit, residual_rad_s=held_out)), residual_rad_s=held_out
    )


def fit_percent_of(segments: list[LogSegment], fit: Fit) -> float:
    """Return the fit in percent of the residuals of a fit, without the glitches."""
    use = ~fit.is_glitch & are_shown(segments)
    return fit_percent(all_speeds(segments)[use], fit.residual_rad_s[use])


def fit_percent(measured: FloatArray, residual: FloatArray) -> float:
    """Return 100 (1 - |y - yhat| / |y - mean y|), as MATLAB's `compare`; 0 if nothing moves."""
    motion = float(np.linalg.norm(measured - measured.mean())) if len(measured) else 0.0
    return 100.0 * (1.0 - float(np.linalg.norm(residual)) / motion) if motion > 0.0 else 0.0


def _blocks(segments: list[LogSegment]) -> NDArray[np.intp]:
    """Return the held-out block of each window, shape (n,)."""
    total = sum(len(s.speed_rad_s) for s in segments)
    result: NDArray[np.intp] = np.arange(total) * BLOCKS // total
    return result
