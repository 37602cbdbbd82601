"""Logged speeds that a low-pass filter smoothed, as `speed += 0.1 * (raw - speed)` in a sketch does.

The fit reads smoothed speeds as means over a window. A first-order filter before or behind the motor looks
alike, but for the friction: its time constant and the motor's can change places.
"""

from dataclasses import dataclass, replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.least_squares import Scaling, minimize_soft_l1, weights
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.prediction import predict
from thumper_tuning.identify.segments import LogSegment, median_window_s, with_sensor_window

BETTER = 0.97  # of the loss: what a filter must reach to explain the speeds better than a window
LEAST_WINDOWS = 1.5  # rows that a smoothed speed is averaged over
LIMITS = (0.1, 20.0)  # of the start values


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredModel:
    """A motor whose logged speeds passed a first-order low-pass."""

    model: MotorModel
    filter_s: float  # time constant of the low-pass
    loss: float  # soft-L1


def fit_filtered(segments: list[LogSegment], fit: Fit) -> list[FilteredModel]:
    """Return motors behind a first-order low-pass that explain the speeds better than a window, best first.

    Two differ in which of the two time constants is the motor's, if the log does not show it. Empty: counts,
    speeds that are not smoothed, or a window explains them as well.
    """
    window_s = fit.sensor_window_s
    if window_s is None or window_s < LEAST_WINDOWS * median_window_s(segments):
        return []
    # A filter's lag is its time constant, a window's is half of it.
    best = _solve(segments, fit, fit.model, 0.5 * window_s)
    changed = replace(best.model, time_constant_s=best.filter_s)
    found = [best, _solve(segments, fit, changed, best.model.time_constant_s)]
    found.sort(key=lambda one: one.loss)
    of_window = _loss(fit.residual_rad_s * _weight(segments, fit))
    if found[0].loss > BETTER * of_window:
        return []
    return [one for one in found if BETTER * one.loss <= found[0].loss]


def _solve(segments: list[LogSegment], fit: Fit, start: MotorModel, filter_s: float) -> FilteredModel:
    over_rows, weight = with_sensor_window(segments, None), _weight(segments, fit)
    scaling = Scaling.from_segments(segments)
    low, high = np.log(LIMITS).tolist()

    def residuals(x: FloatArray) -> FloatArray:
        model = scaling.model(x, start)
        return _residuals(over_rows, model, filter_s * float(np.exp(x[5]))) * weight

    x = minimize_soft_l1(
        residuals,
        [*scaling.variables(start), 0.0],
        ([-2.0, low, -1.5, -1.5, 0.0, low], [2.0, high, 0.98, 0.98, 8.0, high]),
        [0.1, 0.2, 0.05, 0.05, 0.2, 0.2],
        diff_step=1e-4,
        max_nfev=40,
    )
    model, loss = scaling.model(x, start), _loss(residuals(x))
    return FilteredModel(model=model, filter_s=filter_s * float(np.exp(x[5])), loss=loss)


def _weight(segments: list[LogSegment], fit: Fit) -> FloatArray:
    return weights(segments) * ~fit.is_glitch / fit.scale_rad_s


def _loss(scaled: FloatArray) -> float:
    return float(np.sum(np.sqrt(1.0 + scaled**2) - 1.0))


def _residuals(segments: list[LogSegment], model: MotorModel, filter_s: float) -> FloatArray:
    return np.concatenate(
        [
            s.speed_rad_s
            - _low_pass(predict(s, model), s.windows_s, filter_s, 0.0 if s.at_rest else s.speed_rad_s[0])
            for s in segments
        ]
    )


@kernel
def _low_pass(raw: FloatArray, windows_s: FloatArray, filter_s: float, initial: float) -> FloatArray:
    filtered = np.empty(len(raw))
    last = initial
    for k in range(len(raw)):
        last += (raw[k] - last) * (1.0 - np.exp(-windows_s[k] / filter_s))
        filtered[k] = last
    return filtered
