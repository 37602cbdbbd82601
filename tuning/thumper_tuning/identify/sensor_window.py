"""Fit logs whose speeds were averaged over an unknown time, as of a filtered sensor or a motor controller."""

from dataclasses import replace

import numpy as np

from thumper_tuning.identify.fit import Fit, fit_motor
from thumper_tuning.identify.initial_guess import initial_guesses
from thumper_tuning.identify.least_squares import FitData
from thumper_tuning.identify.segments import LogSegment

WINDOWS_S = (0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3)
REFINEMENTS = (0.85, 1.18)  # of the best window of the grid
MAX_PERIOD_S = 0.04  # slower logs do not show a window


def fit_sensor_window(segments: list[LogSegment], row_s: float) -> tuple[Fit | None, list[LogSegment]]:
    """Return the fit with the best window, and the segments with it; None if rows are too slow to show it.

    The initial guesses decide between the windows of a grid, and full fits between those around the best.
    """
    if row_s > MAX_PERIOD_S:
        return None, segments
    ranked = []
    for window_s in WINDOWS_S:
        if window_s > row_s:
            guesses = initial_guesses(FitData(segments=_with(segments, window_s), instantaneous=True))
            ranked += [(guesses[0].residual_rad_s, window_s)] if guesses else []
    if not ranked:
        return None, segments
    best_s = min(ranked)[1]
    fits = []
    for window_s in (best_s, *(best_s * factor for factor in REFINEMENTS)):
        fit = fit_motor(_with(segments, window_s), instantaneous=True)
        if fit is not None:
            fits.append((rms_residual(fit), window_s, fit))
    if not fits:
        return None, segments
    _, window_s, fit = min(fits, key=lambda found: found[0])
    return fit, _with(segments, window_s)


def rms_residual(fit: Fit) -> float:
    """Return the rms residual without glitches; unlike a mean of absolutes, the steps decide it."""
    return float(np.sqrt(np.mean(fit.residual_rad_s[~fit.is_glitch] ** 2)))


def _with(segments: list[LogSegment], window_s: float) -> list[LogSegment]:
    return [replace(s, sensor_window_s=window_s) for s in segments]
