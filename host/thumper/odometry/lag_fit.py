"""Fit a first-order lag with several inputs, tick by tick, in bounded time and memory. Pure: no I/O.

Given its time constant tau, the mean speed over a tick is linear in the inputs passed through the exact lag.
Each tau of a bank has its own recursive least-squares fit: information form, exponential forgetting, a prior
that bounds it. Their residuals over ln tau give tau (separable least squares, Golub and Pereyra 1973). The
speed is no regressor, so counting does not bias the fit. The board's controller reacts to the noise: only
white residuals leave the fit without bias (Ljung 1999, 13.4).
"""

import math
from collections.abc import Sequence

import numpy as np

from thumper.common.geometry import FloatArray

MEMORY_TICKS = 1200.0  # of forgetting: 120 s of driving at 10 Hz
MIN_TICKS = 100.0
# The noise of the torque outlasts a tick (the pole), and the counted speed is a mean over the tick (the
# zero). The equation passes (1 - 0.5 / z) / (1 + 0.35 / z), which makes this noise white. It is that of the
# simulator's torque, with an assumed correlation time of 0.1 s. With 0.03, 0.1 and 0.3 s the worst gain is
# 1.0 % off and the worst time constant 1.5 % (tests/host/odometry/test_lag_fit.py, noise of 0.16 rad/s, three
# drives of 60 s each).
NOISE_POLE, NOISE_ZERO = 0.5, -0.35
HUBER_SIGMAS = 2.5
INITIAL_PRIOR = 1e-6

Row = tuple[FloatArray, float]


class LagFit:
    """One equation; its last unknown is the state at the start of the present stretch of ticks."""

    def __init__(self, lags_s: FloatArray, prior: Sequence[float], *, drives: int, delay_s: float) -> None:
        """`prior`: information per input without data, in its squared units.

        `drives`: how many of the inputs, the first ones, come `delay_s` after the tick.
        """
        self.lags_s, self._drives, self._delay_s = lags_s, drives, delay_s
        self.prior = np.array((*prior, INITIAL_PRIOR))
        bank, n = len(lags_s), len(self.prior)
        self._state = np.zeros((bank, n))  # each lag's response to each input, now; last: to the first state
        self._input_before = np.zeros(n)
        self._row: Row | None = None  # regressors and speed of the previous good tick
        self._white: Row | None = None  # the same, with white noise
        # Sums of row row' and of speed row over the ticks, for each lag; theta = information^-1 moment.
        self.information, self.moment = np.zeros((bank, n, n)), np.zeros((bank, n))
        self._power = np.zeros(bank)  # of the speed
        self.ticks = self._ticks_twice_forgotten = 0.0
        self._place = 0.0  # of the minimum in the bank, between two of its lags
        self.best, self.theta = -1, np.zeros(n)  # the best lag's place in the bank (-1: none yet) and its fit
        self._std_rad_s = math.inf
        self._added = 0
        self._residual = self._squares = self._products = 0.0  # products: of residuals of successive ticks

    def step(self, period_s: float, inputs: Sequence[float], speed_rad_s: float, *, good: bool) -> None:
        """Pass one tick: constant inputs, and the mean speed, fitted if good."""
        row = self._filter(period_s, np.array((*inputs, 0.0)))
        if not good:
            self.break_off()
            return
        if self._row is not None:
            white, y = row - NOISE_POLE * self._row[0], speed_rad_s - NOISE_POLE * self._row[1]
            if self._white is not None:
                white, y = white + NOISE_ZERO * self._white[0], y + NOISE_ZERO * self._white[1]
            self._add(white, y)
            self._white = white, y
        self._row = row, speed_rad_s

    def _filter(self, period_s: float, inputs: FloatArray) -> FloatArray:
        """Pass the inputs through each lag of the bank; return the means over the tick, shape (bank, n)."""
        turned, lags_s = np.zeros_like(self._state), self.lags_s[:, None]
        delayed = inputs.copy()
        delayed[: self._drives] = self._input_before[: self._drives]
        for held, part_s in ((delayed, self._delay_s), (inputs, period_s - self._delay_s)):
            decay = np.exp(-part_s / lags_s)
            turned += held * part_s + (self._state - held) * (lags_s * (1.0 - decay))
            self._state = held + (self._state - held) * decay
        self._input_before = inputs
        return turned / period_s

    def break_off(self) -> None:
        """Start again from an unknown state: ticks are missing, or the model does not hold in them."""
        if self._row is not None:
            self._forget_initial_state()
        self._row = self._white = None
        self._state[:, -1] = 1.0

    def _add(self, row: FloatArray, y: float) -> None:
        keep = 1.0 - 1.0 / MEMORY_TICKS
        weight = 1.0
        if self.best >= 0:
            residual = y - float(row[self.best] @ self.theta)
            weight = min(1.0, HUBER_SIGMAS * self._std_rad_s / max(abs(residual), 1e-9))
            clipped = weight * residual
            self._products = keep * self._products + clipped * self._residual
            self._squares = keep * self._squares + clipped**2
            self._residual = clipped
        self.information = keep * self.information + weight * row[:, :, None] * row[:, None, :]
        self.moment = keep * self.moment + weight * y * row
        self._power = keep * self._power + weight * y * y
        self.ticks = keep * self.ticks + weight
        self._ticks_twice_forgotten = keep**2 * self._ticks_twice_forgotten + weight
        self._added += 1
        if self._added % 50 == 0 and self.ticks >= MIN_TICKS:
            self.solve()

    def _forget_initial_state(self) -> None:
        """Marginalize the initial state of the stretch that ends: the next one has its own."""
        pivot = self.information[:, -1, -1] + INITIAL_PRIOR
        across = self.information[:, :, -1]
        share = across / pivot[:, None]
        at_initial = self.moment[:, -1].copy()
        self._power -= at_initial**2 / pivot
        self.moment -= share * at_initial[:, None]
        self.information -= share[:, :, None] * across[:, None, :]
        self.information[:, -1, :] = self.information[:, :, -1] = 0.0
        self.moment[:, -1] = 0.0
        self._residual = 0.0

    def solve(self) -> FloatArray:
        """Solve the fit of each lag and choose the best; return their sums of squares, shape (bank,)."""
        theta = np.linalg.solve(self.information + np.diag(self.prior), self.moment[:, :, None])[:, :, 0]
        squares: FloatArray = self._power - 2.0 * np.einsum("bi,bi->b", theta, self.moment)
        squares += np.einsum("bi,bij,bj->b", theta, self.information, theta)
        squares = np.maximum(squares, 1e-12)
        self.best = int(np.argmin(squares))
        self._place = self.best + _offset(np.log(squares[max(self.best - 1, 0) : self.best + 2]))
        self.theta = theta[self.best]
        self._std_rad_s = math.sqrt(squares[self.best] / max(self.ticks - len(self.prior), 1.0))
        return squares

    def independent_ticks(self) -> float:
        """Return how many ticks of white noise the sums are worth.

        Forgetting gives old ticks less weight in the sums, and less than that in the variance.
        """
        correlation = min(max(self._products / max(self._squares, 1e-12), 0.0), 0.9)
        return self.ticks**2 / self._ticks_twice_forgotten * (1.0 - correlation) / (1.0 + correlation)

    def variance(self) -> float:
        """Return what the inverse of the best lag's information is to be multiplied with."""
        return self._std_rad_s**2 * self.ticks / self.independent_ticks()

    def at_minimum(self) -> tuple[FloatArray, FloatArray]:
        """Return information (n, n) and moment (n,) of the lag that `solve` found, between two of the bank.

        Those of the best lag of the bank would bias the gain: it may be half a step, 5 %, from the minimum.
        """
        below = min(int(self._place), len(self.lags_s) - 2)
        weights = (below + 1.0 - self._place, self._place - below)
        information: FloatArray = np.tensordot(weights, self.information[below : below + 2], 1)
        moment: FloatArray = np.tensordot(weights, self.moment[below : below + 2], 1)
        return information, moment

    def marginal(self, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return information and moment of the chosen unknowns, without the others."""
        others = [k for k in range(len(self.prior)) if k not in chosen]
        full, moment = self.at_minimum()
        across = full[np.ix_(chosen, others)]
        share = np.linalg.solve(full[np.ix_(others, others)] + np.diag(self.prior[others]), across.T).T
        variance = self.variance()
        information: FloatArray = (full[np.ix_(chosen, chosen)] - share @ across.T) / variance
        return information, (moment[list(chosen)] - share @ moment[others]) / variance


def _offset(values: FloatArray) -> float:
    """Return how far from the second of three values their parabola has its minimum; 0 for fewer values."""
    if len(values) < 3:
        return 0.0
    bend = values[0] - 2.0 * values[1] + values[2]
    return float(0.5 * (values[0] - values[2]) / bend) if bend > 0.0 else 0.0
