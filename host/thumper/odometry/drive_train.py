"""Estimate gain, time constant and friction of the wheels from ordinary driving. Pure: no I/O, no clock.

The model of each side is that of `thumper tune`: `tau dw/dt + w = K (u - kS sign(w))`, counted per tick.
Tyres that scrub in a turn couple the sides by an unknown moment, up to three times the friction. It acts on
both sides with opposite signs, so their mean does not contain it. The fit is to that mean, y:

    tau dy/dt + y = K um + p ud - c (sL + sR) / 2 - d (sR - sL) / 2 - delta yd

with mean and half difference (right minus left) of drive, um and ud, and of speed, y and yd, and the signs of
motion s. The sides' gains are `K -+ (p - K delta)`, their frictions `(c -+ d) / K` and their time constants
`tau / (1 -+ delta)`, to first order. With tau given, the rest is linear in the inputs passed through the
exact counted lag. Each tau of a bank has its own recursive least-squares fit (information form, exponential
forgetting, a prior that bounds it). The profile of their residuals over ln tau gives tau and its uncertainty
(separable least squares, Golub and Pereyra 1973). y is no regressor, so counting does not bias the fit.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.odometry.wheel_odometry import count_delta

REFERENCE_V = 7.4  # the drive is PWM at this voltage, as in the board's kv and ks
BANK_S = np.geomspace(0.02, 0.8, 36)
MEMORY_TICKS = 1200.0  # of forgetting: 120 s of driving at 10 Hz
MIN_TICKS = 100.0
NOISE_POLE = 0.6  # the noise of the torque outlasts a tick: the equation passes 1 - 0.6 / z
HUBER_SIGMAS = 2.5
MAX_GAP_S = 0.15  # after a longer interval telemetry is missing
K, P, C, D, DELTA, INITIAL = range(6)
# Information without data, in squared units of the regressors: it bounds what the drive does not excite.
PRIOR = np.array((1.0, 500.0, 1e-3, 0.05, 2.0, 1e-6))


class WheelTick(NamedTuple):
    """Both sides at a control tick, as the board reports it."""

    time_us: int  # wraps at 2**32
    left_count: int  # wraps, as an int32
    right_count: int
    left_pwm: int  # from this tick until the next
    right_pwm: int
    battery_V: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its standard deviation."""

    value: float
    std: float

    def within(self, share: float) -> bool:
        """Return whether two standard deviations are within this share of the value."""
        return 2.0 * self.std <= share * abs(self.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelEstimate:
    """One side's motor, or the mean of both; None is not determined by the driving so far."""

    gain: Estimate | None  # [rad/s per PWM at 7.4 V]
    time_constant_s: Estimate | None
    friction: Estimate | None  # [PWM at 7.4 V]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveTrainEstimate:
    """Both sides and their mean."""

    mean: WheelEstimate
    left: WheelEstimate
    right: WheelEstimate
    # Left minus right [PWM at 7.4 V]. Only turns in place show it, or curves with one side backward.
    friction_difference: Estimate | None = None


NOTHING = WheelEstimate(gain=None, time_constant_s=None, friction=None)
MAX_STD = {"gain": 0.03, "time_constant": 0.10}  # two standard deviations, as shares of the value
MAX_FRICTION_STD_PWM = 2.0


class DriveTrainEstimator:
    """Takes one tick after the other, in bounded time and memory; `estimate` solves for the parameters."""

    def __init__(self, *, counts_per_rev: float, delay_s: float = 0.0) -> None:
        """`delay_s`: from a tick to its output, half a PWM period."""
        self._rad_per_count = 2.0 * math.pi / counts_per_rev
        self._delay_s = delay_s
        self._last: WheelTick | None = None
        self._signs = (0.0, 0.0)
        self._state = np.zeros((len(BANK_S), len(PRIOR)))  # instantaneous response to each input
        self._row: tuple[FloatArray, float] | None = None  # regressors and speed of the previous good tick
        self._input_before = np.zeros(len(PRIOR))
        self._fit = _Bank()

    def add(self, tick: WheelTick) -> None:
        """Add the next tick."""
        last, self._last = self._last, tick
        if last is None:
            return
        period_s = (tick.time_us - last.time_us) % 2**32 * 1e-6
        if not 0.0 < period_s <= MAX_GAP_S:
            self._break_off()
            return
        rad_s = self._rad_per_count / period_s
        left = count_delta(last.left_count, tick.left_count) * rad_s
        right = count_delta(last.right_count, tick.right_count) * rad_s
        self._step(period_s, (last.left_pwm, last.right_pwm), (left, right), last.battery_V)

    def _step(
        self, period_s: float, pwm: tuple[int, int], speed: tuple[float, float], battery_V: float
    ) -> None:
        scale, signs = battery_V / REFERENCE_V, (np.sign(speed[0]), np.sign(speed[1]))
        left, right = scale * pwm[0], scale * pwm[1]
        y, yd = 0.5 * (speed[0] + speed[1]), 0.5 * (speed[1] - speed[0])
        inputs = np.array(
            (0.5 * (left + right), 0.5 * (right - left), -0.5 * (signs[0] + signs[1]),
             -0.5 * (signs[1] - signs[0]), -yd, 0.0)
        )  # fmt: skip
        regressors = self._filter(period_s, inputs)
        # A bridge at PWM 0 coasts; a side that starts, stops or reverses has two frictions in one tick.
        driven = battery_V > 0.0 and pwm[0] != 0 and pwm[1] != 0
        good = driven and signs == self._signs and signs[0] != 0.0 and signs[1] != 0.0
        self._signs = signs
        if not good:
            self._break_off(at_rest=signs == (0.0, 0.0))
            return
        if self._row is not None:
            before, y_before = self._row
            self._fit.add(regressors - NOISE_POLE * before, y - NOISE_POLE * y_before)
        self._row = regressors, y

    def _filter(self, period_s: float, inputs: FloatArray) -> FloatArray:
        """Pass the inputs through each lag of the bank; return the means over the tick, shape (bank, 6)."""
        turned = np.zeros_like(self._state)
        delayed = inputs.copy()
        delayed[[K, P]] = self._input_before[[K, P]]
        for held, part_s in ((delayed, self._delay_s), (inputs, period_s - self._delay_s)):
            decay = np.exp(-part_s / BANK_S)[:, None]
            turned += held * part_s + (self._state - held) * (BANK_S[:, None] * (1.0 - decay))
            self._state = held + (self._state - held) * decay
        self._input_before = inputs
        return turned / period_s

    def _break_off(self, *, at_rest: bool = False) -> None:
        """Start again from an unknown state, or from rest."""
        if at_rest:
            self._state[:] = 0.0
        if self._row is not None or at_rest:
            self._fit.forget_initial_state()
        self._row = None
        self._state[:, INITIAL] = 0.0 if at_rest else 1.0

    def estimate(self) -> DriveTrainEstimate:
        """Return what the driving so far determines; takes about a millisecond."""
        return self._fit.estimate()


@dataclass(slots=True)
class _Bank:
    """A recursive least-squares fit for each time constant of the bank, in information form."""

    information: FloatArray = field(default_factory=lambda: np.zeros((len(BANK_S), len(PRIOR), len(PRIOR))))
    moment: FloatArray = field(default_factory=lambda: np.zeros((len(BANK_S), len(PRIOR))))
    power: FloatArray = field(default_factory=lambda: np.zeros(len(BANK_S)))  # of the speed
    ticks: float = 0.0
    theta: FloatArray = field(default_factory=lambda: np.zeros(len(PRIOR)))  # of the best fit, solved last
    best: int = -1  # its place in the bank; -1: none yet
    std_rad_s: float = math.inf
    added: int = 0
    residual: float = 0.0
    squares: float = 0.0
    products: float = 0.0  # of residuals of successive ticks

    def add(self, row: FloatArray, y: float) -> None:
        """Add a tick: regressors, shape (bank, 6), and speed."""
        keep = 1.0 - 1.0 / MEMORY_TICKS
        weight = 1.0
        if self.best >= 0:
            residual = y - float(row[self.best] @ self.theta)
            weight = min(1.0, HUBER_SIGMAS * self.std_rad_s / max(abs(residual), 1e-9))
            clipped = weight * residual
            self.products = keep * self.products + clipped * self.residual
            self.squares = keep * self.squares + clipped**2
            self.residual = clipped
        self.information = keep * self.information + weight * row[:, :, None] * row[:, None, :]
        self.moment = keep * self.moment + weight * y * row
        self.power = keep * self.power + weight * y * y
        self.ticks = keep * self.ticks + weight
        self.added += 1
        if self.added % 50 == 0 and self.ticks >= MIN_TICKS:
            self.solve()

    def forget_initial_state(self) -> None:
        """Marginalize the initial state of the stretch that ends: the next one has its own."""
        pivot = self.information[:, INITIAL, INITIAL] + PRIOR[INITIAL]
        across = self.information[:, :, INITIAL]
        share = across / pivot[:, None]
        at_initial = self.moment[:, INITIAL].copy()
        self.power -= at_initial**2 / pivot
        self.moment -= share * at_initial[:, None]
        self.information -= share[:, :, None] * across[:, None, :]
        self.information[:, INITIAL, :] = self.information[:, :, INITIAL] = 0.0
        self.moment[:, INITIAL] = 0.0
        self.residual = 0.0

    def solve(self) -> tuple[FloatArray, FloatArray]:
        """Solve all fits; return the parameters, shape (bank, 6), and the sums of squares, shape (bank,)."""
        theta = np.zeros_like(self.moment)
        theta += np.linalg.solve(self.information + np.diag(PRIOR), self.moment[:, :, None])[:, :, 0]
        squares = np.zeros_like(self.power)
        squares += self.power - 2.0 * np.einsum("bi,bi->b", theta, self.moment)
        squares += np.einsum("bi,bij,bj->b", theta, self.information, theta)
        squares[:] = np.maximum(squares, 1e-12)
        self.best = int(np.argmin(squares))
        self.theta = theta[self.best]
        self.std_rad_s = math.sqrt(squares[self.best] / max(self.ticks - len(PRIOR), 1.0))
        return theta, squares

    def estimate(self) -> DriveTrainEstimate:
        """Return what the fits determine."""
        if self.ticks < MIN_TICKS:
            return DriveTrainEstimate(mean=NOTHING, left=NOTHING, right=NOTHING)
        theta, squares = self.solve()
        correlation = min(max(self.products / max(self.squares, 1e-12), 0.0), 0.9)
        independent = self.ticks * (1.0 - correlation) / (1.0 + correlation)
        tau = _time_constant(squares, independent)
        covariance = np.linalg.inv(self.information[self.best] + np.diag(PRIOR))
        covariance *= self.std_rad_s**2 * self.ticks / independent
        return DriveTrainEstimate(
            mean=_side(theta[self.best], covariance, tau, 0.0),
            left=_side(theta[self.best], covariance, tau, -1.0),
            right=_side(theta[self.best], covariance, tau, 1.0),
            friction_difference=_friction_difference(theta[self.best], covariance),
        )


def _time_constant(squares: FloatArray, independent: float) -> Estimate | None:
    """Return the time constant at the minimum of the profile; None at the ends of the bank."""
    j = int(np.argmin(squares))
    if j in (0, len(BANK_S) - 1):
        return None
    step = math.log(BANK_S[1] / BANK_S[0])
    below, at, above = 0.5 * independent * np.log(squares[j - 1 : j + 2])
    curvature = (above - 2.0 * at + below) / step**2
    if curvature <= 0.0:
        return None
    tau_s = float(BANK_S[j] * math.exp(-(above - below) / (2.0 * step) / curvature))
    return Estimate(tau_s, tau_s / math.sqrt(curvature))


def _side(theta: FloatArray, covariance: FloatArray, tau: Estimate | None, sign: float) -> WheelEstimate:
    """Return the estimate of the left (-1) or right (1) side, or of their mean (0)."""
    gain = theta[K] + sign * (theta[P] - theta[K] * theta[DELTA])
    if gain <= 0.0:
        return NOTHING
    friction = (theta[C] + sign * theta[D]) / gain
    by_gain, by_friction = np.zeros(len(PRIOR)), np.zeros(len(PRIOR))
    by_gain[[K, P, DELTA]] = 1.0 - sign * theta[DELTA], sign, -sign * theta[K]
    by_friction[[C, D]] = 1.0 / gain, sign / gain
    by_friction -= by_gain * friction / gain
    found_gain = Estimate(float(gain), _std(by_gain, covariance))
    found_friction = Estimate(float(friction), _std(by_friction, covariance))
    lag = None
    if tau is not None:
        share = 1.0 + sign * float(theta[DELTA])
        spread = abs(sign) * math.sqrt(covariance[DELTA, DELTA])
        lag = Estimate(tau.value / share, tau.value / share * math.hypot(tau.std / tau.value, spread))
    return WheelEstimate(
        gain=found_gain if found_gain.within(MAX_STD["gain"]) else None,
        time_constant_s=lag if lag is not None and lag.within(MAX_STD["time_constant"]) else None,
        friction=found_friction if 2.0 * found_friction.std <= MAX_FRICTION_STD_PWM else None,
    )


def _friction_difference(theta: FloatArray, covariance: FloatArray) -> Estimate | None:
    if theta[K] <= 0.0:
        return None
    value = -2.0 * theta[D] / theta[K]
    gradient = np.zeros(len(PRIOR))
    gradient[[K, D]] = -value / theta[K], -2.0 / theta[K]
    return Estimate(float(value), _std(gradient, covariance))


def _std(gradient: FloatArray, covariance: FloatArray) -> float:
    return math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
