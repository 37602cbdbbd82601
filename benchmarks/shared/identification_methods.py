"""Ways to identify a wheel from a log of counts and PWM: Thumper's, and those that others use.

The regression has the form of WPILib SysId (acceleration on speed, drive and sign) without its trimming;
SysId itself is not run. ERA is that of python-control.
"""

from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.motor import identify
from thumper_tuning.logs.motor_log import MotorLog

STAIRS = 144  # rows before the switching
MARKOV_S, LEAST_MARKOV = 2.0, 20  # length of the impulse response [s], and its samples at least
Found = tuple[float, float, float]  # gain, time constant, friction
Method = Callable[[MotorLog], Found]


def _rows(log: MotorLog) -> tuple[FloatArray, FloatArray]:
    """Return the mean speed of each interval and the drive at each row, as the other methods use them."""
    if log.position_rad is None:
        assert log.speed_rad_s is not None
        return log.speed_rad_s[1:], log.drive
    return np.diff(log.position_rad) / np.diff(log.time_s), log.drive


def ours(log: MotorLog) -> Found:
    """Run Thumper's output-error fit."""
    model = identify([log]).model
    return model.gain, model.time_constant_s, model.friction


def regression(log: MotorLog) -> Found:
    """Regress the acceleration (central difference) on speed, drive and sign of the speed, in motion."""
    y, u = _rows(log)
    u = u[1:]  # at the end of each window: SysId uses that time for its speed
    acceleration = (y[2:] - y[:-2]) / (log.time_s[3:] - log.time_s[1:-2])
    y, u = y[1:-1], u[1 : len(y) - 1]
    moving = np.abs(y) > 0.3
    X = np.column_stack((y, u, np.sign(y)))[moving]
    alpha, beta, gamma = np.linalg.lstsq(X, acceleration[moving], rcond=None)[0]
    return float(-beta / alpha), float(-1.0 / alpha), float(-gamma / beta)


def arx(order: int) -> Method:
    """Return a least-squares ARX fit with `order` numerator coefficients and the sign of the motion."""

    def fit(log: MotorLog) -> Found:
        y, u = _rows(log)
        rows = np.flatnonzero((np.abs(y[1:]) > 0.3) & (np.abs(y[:-1]) > 0.3)) + 1
        X = np.column_stack([y[rows - 1], *(u[rows - k] for k in range(order)), np.sign(y[rows])])
        theta = np.linalg.lstsq(X, y[rows], rcond=None)[0]
        a, gain = theta[0], theta[1:-1].sum() / (1.0 - theta[0])
        return float(gain), float(-log.period_s / np.log(a)), float(-theta[-1] / theta[1:-1].sum())

    return fit


def instantaneous(log: MotorLog) -> Found:
    """Fit with scipy as tutorials do: speeds as instantaneous values, no friction."""
    from scipy.optimize import least_squares

    speed, drive = _rows(log)

    def predicted(x: FloatArray) -> FloatArray:
        a, y = np.exp(-log.period_s / np.exp(x[1])), np.zeros(len(speed))
        for k in range(1, len(y)):
            y[k] = a * y[k - 1] + (1.0 - a) * np.exp(x[0]) * drive[k]
        return y

    x = least_squares(lambda x: predicted(x) - speed, [np.log(0.05), np.log(0.1)]).x
    return float(np.exp(x[0])), float(np.exp(x[1])), 0.0


def era(order: int, first_row: int) -> Method:
    """Return python-control's eigensystem realization of the impulse response (markov), from a row on.

    In a log of both directions the mean of each is subtracted from drive and speed. This removes the
    friction, which a linear
    model does not have.
    """
    import control

    def fit(log: MotorLog) -> Found:
        speed, drive = _rows(log)
        y, u = speed[first_row:].copy(), drive[first_row:-1].copy()
        for side in (u > 0, u < 0) if u.min() < 0.0 < u.max() else ():
            y[side] -= y[side].mean()
            u[side] -= u[side].mean()
        response = control.markov(y, u, max(round(MARKOV_S / log.period_s), LEAST_MARKOV))
        system, _ = control.eigensys_realization(response, order)
        poles, modes = np.linalg.eig(system.A)
        share = (system.C @ modes)[0] * np.linalg.solve(modes, system.B)[:, 0] / (1.0 - poles)
        pole = np.abs(poles[np.abs(share).argmax()])  # the one that carries most of the gain
        tau_s = -log.period_s / np.log(pole) if pole < 1.0 else np.inf
        return float(system.dcgain()), float(tau_s), float("nan")

    return fit


OURS = "output error, averaged, friction (ours)"


def methods(switching_from: int = 0) -> dict[str, Method]:
    """Return the methods by name; `switching_from`: the first row that ERA uses."""
    return {
        OURS: ours,
        "least squares ARX(1,2) + sign": arx(2),
        "least squares ARX(1,1) + sign": arx(1),
        "regression of the acceleration": regression,
        "output error, instantaneous, no friction": instantaneous,
        "ERA of order 2": era(2, switching_from),
        "ERA of order 1": era(1, switching_from),
    }
