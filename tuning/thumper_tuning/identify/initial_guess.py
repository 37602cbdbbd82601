"""Initial guesses for the fit: with time constant and delay on a grid, the other parameters are linear."""

from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.least_squares import MAX_DELAY_S, FitData
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import one_pole
from thumper_tuning.identify.prediction import observe
from thumper_tuning.identify.realization import (
    impulse_response,
    linear_record,
    realize,
    slow_time_constant_s,
)
from thumper_tuning.identify.segments import LogSegment

TIME_CONSTANTS_S = np.geomspace(0.005, 2.0, 18)
DELAYS_PERIODS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)
LONG_DELAYS_S = (0.1, 0.2, 0.4)  # of a log with fast rows
REWEIGHTINGS = 6
GLITCH_FACTOR = 3.0  # speeds this far above the usual fast ones are glitches


def delays_s(period_s: float) -> list[float]:
    """Return the delays to start from, for a log whose windows last so long."""
    short_s = [min(periods * period_s, MAX_DELAY_S) for periods in DELAYS_PERIODS]
    return short_s + [delay_s for delay_s in LONG_DELAYS_S if delay_s > short_s[-1]]


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialGuess:
    """A model to start the fit from, and its mean absolute residual [rad/s]."""

    model: MotorModel
    residual_rad_s: float


def initial_guesses(data: FitData, era_s: float | None) -> list[InitialGuess]:
    """Return the best guess for each delay on the grid, best first.

    In motion, the speed is linear in gain and gain x friction once time constant and delay are given: the
    drive and the sign of the motion pass the same one-pole filter. Each least-squares fit is reweighted
    towards an L1 fit, so that glitches do not decide. `era_s`, the time constant of python-control's ERA
    model, is on the grid, too.
    """
    time_constants_s = [*TIME_CONSTANTS_S.tolist(), *([era_s] if era_s is not None else [])]
    y, period_s = data.speed_rad_s, data.period_s
    nonzero = np.abs(y[y != 0.0]) if y.any() else np.ones(1)
    plausible = np.abs(y) <= GLITCH_FACTOR * np.percentile(nonzero, 90)
    plausible &= ~np.concatenate([s.is_clipped for s in data.segments])
    moving = 0.03 * float(np.percentile(np.abs(y), 95))
    y = y[plausible]
    floor = 1e-3 * float(np.percentile(np.abs(y), 95)) + 1e-12
    found = []
    for delay_s in delays_s(period_s):
        best: InitialGuess | None = None
        inputs = [(s, _inputs(s, delay_s, moving)) for s in data.segments]
        for tau_s in time_constants_s:
            X = np.concatenate([_regressors(s, part, tau_s, delay_s) for s, part in inputs], axis=1).T
            theta, residual = _fit_l1(X[plausible], y, floor)
            if theta[0] <= 0.0 or (best is not None and residual >= best.residual_rad_s):
                continue
            model = MotorModel(
                gain=float(theta[0]),
                time_constant_s=float(tau_s),
                friction_forward=float(-theta[1] / theta[0]),
                friction_backward=float(-theta[2] / theta[0]),
                delay_s=delay_s,
            )
            best = InitialGuess(model=model, residual_rad_s=residual)
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda guess: guess.residual_rad_s)


def era_time_constant_s(segments: list[LogSegment]) -> float | None:
    """Return the time constant of ERA's model of order 1; None if its pole is none, or beyond the grid."""
    record = linear_record(segments, None)
    if record is None:
        return None
    tau_s = slow_time_constant_s(realize(impulse_response(record), 1, record.period_s))
    return tau_s if tau_s is not None and TIME_CONSTANTS_S[0] < tau_s < TIME_CONSTANTS_S[-1] else None


def _inputs(s: LogSegment, delay_s: float, moving_rad_s: float) -> FloatArray:
    """Return drive and signs of motion at the segment's changes, shape (3, m)."""
    forward = s.speed_rad_s > moving_rad_s
    backward = s.speed_rad_s < -moving_rad_s
    last = len(forward) - 1
    # The drive of the row at which a window ends is the better guess for what happens in the window.
    at = np.clip(np.searchsorted(s.edge_s[1:], s.change_s + 0.5 * s.windows_s.min()), 0, last)
    shifted = np.clip(np.searchsorted(s.edge_s[1:], s.change_s + delay_s + 1e-9), 0, last)
    in_motion = (forward | backward)[at] | (forward | backward)[shifted]
    drive = np.where(in_motion, s.drive, 0.0)  # at rest, friction cancels the drive
    return np.stack((drive, forward[shifted].astype(float), -backward[shifted].astype(float)))


def _regressors(s: LogSegment, inputs: FloatArray, tau_s: float, delay_s: float) -> FloatArray:
    """Return the inputs behind a one-pole filter with dead time, as the log would hold them, shape (3, n)."""
    initial = np.zeros(len(inputs)) if s.at_rest else inputs[:, 0]
    return observe(s, lambda t, w: one_pole(s.change_s + delay_s, inputs, t, w, tau_s), initial)


def _fit_l1(X: FloatArray, y: FloatArray, floor: float) -> tuple[FloatArray, float]:
    """Fit y = X theta by reweighted least squares; return theta and the mean absolute residual.

    Residuals far below `floor` weigh the same.
    """
    weights = np.ones(len(y))
    theta: FloatArray = np.zeros(X.shape[1])
    for _ in range(REWEIGHTINGS):
        # A direction that the log does not have is a column of zeros: the normal equations may be singular.
        weighted = X.T * weights
        theta[:] = np.linalg.lstsq(weighted @ X, weighted @ y, rcond=None)[0]
        weights = 1.0 / (np.abs(y - X @ theta) + floor)
    return theta, float(np.mean(np.abs(y - X @ theta)))
