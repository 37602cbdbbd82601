"""How well the model predicts what it was not fitted to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.fit import Fit, refit
from thumper_tuning.identify.least_squares import residuals, weights
from thumper_tuning.identify.segments import Segment

BLOCKS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Validation:
    """Held-out residuals of all windows, and the share of the motion that the prediction explains."""

    fit_percent: float
    residual_rad_s: FloatArray


def cross_validate(stretches: list[Segment], fit: Fit) -> Validation:
    """Leave each tenth of the log out in turn, fit the rest, predict it.

    The prediction runs from the start of each stretch on the drive alone. Glitches do not count.
    """
    blocks = blocks_of(stretches)
    held_out = np.zeros(len(blocks))
    for block in np.unique(blocks):
        out = blocks == block
        model = refit(stretches, fit, ~out)
        held_out[out] = residuals(stretches, model, momentary=fit.momentary)[out]
    speed = np.concatenate([s.speed_rad_s for s in stretches])
    use = ~fit.is_glitch & (weights(stretches) > 0.0)
    return Validation(
        fit_percent=fit_percent(speed[use], held_out[use]),
        residual_rad_s=held_out,
    )


def fit_percent(measured: FloatArray, residual: FloatArray) -> float:
    """100 (1 - |y - yhat| / |y - mean y|), as `compare` in MATLAB; 0 where nothing moves."""
    moved = float(np.linalg.norm(measured - measured.mean())) if len(measured) else 0.0
    return 100.0 * (1.0 - float(np.linalg.norm(residual)) / moved) if moved > 0.0 else 0.0


def blocks_of(stretches: list[Segment]) -> NDArray[np.intp]:
    """Which held-out block each window belongs to, shape (n,)."""
    total = sum(len(s.speed_rad_s) for s in stretches)
    result: NDArray[np.intp] = np.arange(total) * BLOCKS // total
    return result
