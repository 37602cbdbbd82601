"""How sure a robust fit is, when its residuals are neither Gaussian nor independent. Pure."""

from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray

SLOPE_STEP = 2e-3  # wide enough to average over the starts and stops that a parameter moves
LAGS = 8


def slopes(
    function: Callable[[FloatArray], FloatArray], x: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Central differences of a residual function, shape (n, len(x)); one-sided at a bound."""
    columns = []
    for i in range(len(x)):
        up, down = x.copy(), x.copy()
        up[i] = min(x[i] + SLOPE_STEP, high[i])
        down[i] = max(x[i] - SLOPE_STEP, low[i])
        columns.append((function(up) - function(down)) / (up[i] - down[i]))
    return np.column_stack(columns)


def sandwich(J: FloatArray, residual: FloatArray) -> FloatArray:
    """Covariance of a soft-L1 fit: inverse curvature x variance of the score x inverse curvature.

    The score's variance holds its autocovariances up to `LAGS` (Newey and West, 1987), so that ripple which
    outlasts a sample does not make the fit look surer than it is.
    """
    pull = residual / np.sqrt(1.0 + residual**2)  # derivative of the soft-L1 loss
    stiffness = (1.0 + residual**2) ** -1.5
    scores = J * pull[:, None]
    meat = scores.T @ scores
    for lag in range(1, min(LAGS, len(residual) - 1) + 1):
        part = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (LAGS + 1.0)) * (part + part.T)
    bread = np.linalg.pinv(J.T @ (J * stiffness[:, None]))
    result: FloatArray = bread @ meat @ bread * (len(residual) / max(len(residual) - J.shape[1], 1))
    return result
