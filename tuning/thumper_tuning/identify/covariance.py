"""Covariance of a robust fit whose residuals are neither Gaussian nor independent. Pure functions."""

from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray

DIFFERENCE_STEP = 2e-3  # large enough to average over starts and stops that shift with a parameter
LAGS = 8


def jacobian(
    function: Callable[[FloatArray], FloatArray], x: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return central differences of a residual function, shape (n, len(x)); one-sided at a bound."""
    columns = []
    for i in range(len(x)):
        up, down = x.copy(), x.copy()
        up[i] = min(x[i] + DIFFERENCE_STEP, high[i])
        down[i] = max(x[i] - DIFFERENCE_STEP, low[i])
        columns.append((function(up) - function(down)) / (up[i] - down[i]))
    return np.column_stack(columns)


def sandwich_covariance(J: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the sandwich covariance of a soft-L1 fit: H^-1 S H^-1 (derivations.md, "The fit").

    S, the variance of the score, includes its autocovariances up to `LAGS` (Bartlett weights of Newey and
    West, 1987). Otherwise torque ripple that outlasts a sample would make the standard deviations too small.
    """
    slope = residual / np.sqrt(1.0 + residual**2)  # first derivative of the soft-L1 loss
    curvature = (1.0 + residual**2) ** -1.5
    scores = J * slope[:, None]
    S = scores.T @ scores
    for lag in range(1, min(LAGS, len(residual) - 1) + 1):
        part = scores[lag:].T @ scores[:-lag]
        S += (1.0 - lag / (LAGS + 1.0)) * (part + part.T)
    H_inverse = np.linalg.pinv(J.T @ (J * curvature[:, None]))
    result: FloatArray = H_inverse @ S @ H_inverse * (len(residual) / max(len(residual) - J.shape[1], 1))
    return result
