"""Start values without a guess: for each time constant and delay on a grid the rest of the model is
linear."""

from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import respond
from thumper_tuning.identify.segments import Segment

TIME_CONSTANTS_S = np.geomspace(0.005, 2.0, 18)
DELAYS_PERIODS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)
REWEIGHTINGS = 6
LONGEST_DELAY_S = 0.6
ABSURD = 3.0  # speeds this far above the usual fast ones are glitches


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialGuess:
    """A model to start the fit from and its robust misfit [rad/s]."""

    model: MotorModel
    misfit: float


def starts(stretches: list[Segment], *, momentary: bool) -> list[InitialGuess]:
    """The best start for each delay on the grid, best first.

    While the wheel turns, the speed is linear in gain and gain x friction once time constant and delay are
    given: the drive and the sign of the motion pass the same one-pole filter. Each least-squares fit is
    reweighted towards an L1 fit, so that glitches do not choose.
    """
    period_s = float(np.median(np.concatenate([s.windows_s for s in stretches])))
    y = np.concatenate([s.speed_rad_s for s in stretches])
    turning = np.abs(y[y != 0.0]) if y.any() else np.ones(1)
    sane = np.abs(y) <= ABSURD * np.percentile(turning, 90)
    moving = 0.03 * float(np.percentile(np.abs(y), 95))
    found = []
    for periods in DELAYS_PERIODS:
        delay_s = min(periods * period_s, LONGEST_DELAY_S)
        best: InitialGuess | None = None
        for tau_s in TIME_CONSTANTS_S:
            X = np.concatenate([_regressors(s, tau_s, delay_s, moving, momentary) for s in stretches])
            theta, misfit = _l1(X[sane], y[sane])
            if theta[0] <= 0.0 or (best is not None and misfit >= best.misfit):
                continue
            model = MotorModel(
                gain=float(theta[0]),
                time_constant_s=float(tau_s),
                friction_forward=float(-theta[1] / theta[0]),
                friction_backward=float(-theta[2] / theta[0]),
                delay_s=delay_s,
            )
            best = InitialGuess(model=model, misfit=misfit)
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda start: start.misfit)


def _regressors(s: Segment, tau_s: float, delay_s: float, moving: float, momentary: bool) -> FloatArray:
    """Filtered drive and filtered signs of motion, shape (n, 3). At rest friction takes all of the drive."""
    forward = s.speed_rad_s > moving
    backward = s.speed_rad_s < -moving
    # Of the row at which a window ends: the window's own row is the better guess for what happens in it.
    at = np.clip(np.searchsorted(s.edge_s[1:], s.change_s + 0.5 * s.windows_s.min()), 0, len(forward) - 1)
    shifted = np.clip(np.searchsorted(s.edge_s[1:], s.change_s + delay_s + 1e-9), 0, len(forward) - 1)
    turns = (forward | backward)[at] | (forward | backward)[shifted]
    signs = (forward.astype(float), -backward.astype(float))
    columns = [_filtered(s, np.where(turns, s.drive, 0.0), tau_s, delay_s, momentary)]
    columns += [_filtered(s, sign[shifted], tau_s, delay_s, momentary) for sign in signs]
    return np.column_stack(columns)


def _filtered(s: Segment, values: FloatArray, tau_s: float, delay_s: float, momentary: bool) -> FloatArray:
    before = 0.0 if s.at_rest else float(values[0])
    angles, speeds = respond(s.change_s, values, before, before, s.edge_s, 1.0, tau_s, 0.0, 0.0, 1.0, delay_s)
    return speeds[1:] if momentary else np.diff(angles) / s.windows_s


def _l1(X: FloatArray, y: FloatArray) -> tuple[FloatArray, float]:
    weights = np.ones(len(y))
    floor = 1e-3 * float(np.percentile(np.abs(y), 95)) + 1e-12
    theta: FloatArray = np.zeros(X.shape[1])
    for _ in range(REWEIGHTINGS):
        theta[:] = np.linalg.lstsq(X * weights[:, None], y * weights, rcond=None)[0]
        weights = 1.0 / np.sqrt(np.abs(y - X @ theta) + floor)
    return theta, float(np.mean(np.abs(y - X @ theta)))
