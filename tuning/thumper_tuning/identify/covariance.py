"""Covariance of a robust fit whose residuals are neither Gaussian nor independent. Pure functions."""

import math
from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray

DIFFERENCE_STEP = 2e-3  # large enough to average over starts and stops that shift with a parameter
MIN_LAGS, LAGS_S = 8, 0.2  # a sensor's filter makes residuals alike for so long


def correlated_lags(period_s: float) -> int:
    """Return over how many windows residuals may be correlated."""
    return max(MIN_LAGS, math.ceil(LAGS_S / period_s))


def correlation_factor(residual: FloatArray, lags: int) -> float:
    """Return how many correlated residuals count as one: 1 + 2 sum of the correlations, at least 1."""
    power = max(float(residual @ residual), 1e-12)
    lags = min(lags, len(residual) - 1)
    parts = [(1.0 - k / (lags + 1.0)) * float(residual[k:] @ residual[:-k]) for k in range(1, lags + 1)]
    return max(1.0 + 2.0 * sum(parts) / power, 1.0)


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


def sandwich_covariance(J: FloatArray, residual: FloatArray, lags: int) -> FloatArray:
    """Return the sandwich covariance of a soft-L1 fit: H^-1 S H^-1 (derivations.md, "The fit").

    S, the variance of the score, includes its autocovariances up to `lags` (Bartlett weights of Newey and
    West, 1987). Otherwise torque ripple that outlasts a sample would make the standard deviations too small.
    """
    slope = residual / np.sqrt(1.0 + residual**2)  # first derivative of the soft-L1 loss
    curvature = (1.0 + residual**2) ** -1.5
    scores = J * slope[:, None]
    S = scores.T @ scores
    lags = min(lags, len(residual) - 1)
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        S += (1.0 - lag / (lags + 1.0)) * (part + part.T)
    H_inverse = np.linalg.pinv(J.T @ (J * curvature[:, None]))
    result: FloatArray = H_inverse @ S @ H_inverse * (len(residual) / max(len(residual) - J.shape[1], 1))
    return result
