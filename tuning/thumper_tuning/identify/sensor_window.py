"""The part of delay and sensor's window that a log of speeds does not tell apart.

While drive and rows have one clock, and delay plus window fit into a row, no speed shows them apart: only
`delay + tau ln((e^(W/tau) - 1) / (W/tau))` shows, their sum. The likelihood is flat along this line, so its
curvature does not give the standard deviations: they come out too small, or as seconds. Its values along the
line do, from no window to no delay.
"""

import math
from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.covariance import correlated_lags, correlation_factor
from thumper_tuning.identify.least_squares import FitData, weights
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.logs.motor_log import BoolArray

POINTS = 16
UNIFORM_STD = 3.0**-0.5  # of a uniform distribution about one of its ends, per width


def with_window_spread(
    uncertainty: Uncertainty, data: FitData, model: MotorModel, use: BoolArray, scale_rad_s: float
) -> Uncertainty:
    """Add how far window and delay may be along the line, each weighted by the likelihood."""
    window_s = data.sensor_window_s
    if window_s is None:
        return uncertainty
    tau_s = model.time_constant_s
    total_s = model.delay_s + _mean_age_s(window_s, tau_s)
    grid_s = np.linspace(0.0, 2.0 * total_s, POINTS)
    pairs = [(w, total_s - _mean_age_s(w, tau_s)) for w in grid_s.tolist()]
    pairs = [(window_s, model.delay_s), *[(w, delay_s) for w, delay_s in pairs if delay_s >= 0.0]]
    minus_log = np.array(
        [
            _minus_log_likelihood(data.with_sensor_window(w), replace(model, delay_s=d), use, scale_rad_s)
            for w, d in pairs
        ]
    )
    weight = np.exp(np.minimum(minus_log[0] - minus_log, 0.0))
    windows_s = np.array([w for w, _ in pairs])
    along_s = float(np.sqrt(weight @ (windows_s - window_s) ** 2 / weight.sum()))
    slope, curved_s = _mean_age_slope(window_s, tau_s), uncertainty.sensor_window_s
    sum_with_window_s2 = uncertainty.delay_with_window_s2 + slope * curved_s**2
    sum_s2 = uncertainty.delay_s**2 + slope * (uncertainty.delay_with_window_s2 + sum_with_window_s2)
    widest_s = UNIFORM_STD * (float(np.ptp(windows_s)) + 2.0 * math.sqrt(max(sum_s2, 0.0)))
    std_s = min(math.hypot(curved_s, along_s), widest_s)
    sum_with_window_s2 *= min(std_s / max(curved_s, 1e-12), 1.0)  # the correlation stays
    return replace(
        uncertainty,
        sensor_window_s=std_s,
        delay_s=math.sqrt(max(sum_s2 - 2.0 * slope * sum_with_window_s2 + (slope * std_s) ** 2, 0.0)),
        delay_with_window_s2=sum_with_window_s2 - slope * std_s**2,
    )


def _mean_age_s(window_s: float, tau_s: float) -> float:
    """Return the delay that has the effect of a window on a first-order lag: half of it, if it is short."""
    x = window_s / tau_s
    return tau_s * math.log(math.expm1(x) / x) if x > 1e-6 else 0.5 * window_s


def _mean_age_slope(window_s: float, tau_s: float) -> float:
    """Return how much the mean age grows with the window: 1/2 if it is short, 1 if it is long."""
    x = window_s / tau_s
    return 1.0 / -math.expm1(-x) - 1.0 / x if x > 1e-3 else 0.5


def _minus_log_likelihood(data: FitData, model: MotorModel, use: BoolArray, scale_rad_s: float) -> float:
    residual: FloatArray = data.residuals(model)[use] * weights(data.segments)[use] / scale_rad_s
    loss = float(np.sum(np.sqrt(1.0 + residual**2) - 1.0))
    return loss / correlation_factor(residual, correlated_lags(data.period_s))
