"""Estimate gain, time constant and friction of the wheels from ordinary driving. Pure: no I/O, no clock.

The model of each side is that of `thumper tune`: `tau dw/dt + w = K (u - kS sign(w))`, counted per tick.
Tyres that scrub in a turn couple the sides by an unknown moment, up to three times the friction. It acts on
both sides with opposite signs, so their mean does not contain it. The first equation is that of the mean, y:

    tau dy/dt + y = K um + p ud - c (sL + sR) / 2 - d (sR - sL) / 2 - delta yd

with mean and half difference (right minus left) of drive, um and ud, and of speed, y and yd, and the signs of
motion s. The second is that of the half difference, where both sides clearly turn against each other and the
tyres slide: then the moment's size m is constant, and only its sign changes with the turn's:

    tau' dyd/dt + yd = K' ud + p um - delta y - d (sL + sR) / 2 - c (sR - sL) / 2 - m sign(yd)

K', c and m depend on the floor here, and are not used. p, delta and d are those of the mean: what a turn to
the left needs more than the same turn to the right. Both equations together give them.

Left (-) and right (+) have the gains `(K -+ p) / (1 -+ delta)`, the frictions `(c -+ d) / (K -+ p)` and the
time constants `tau / (1 -+ delta)`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.odometry.lag_fit import MIN_TICKS, LagFit
from thumper.odometry.wheel_odometry import count_delta

REFERENCE_V = 7.4  # the drive is PWM at this voltage, as in the board's kv and ks
BANK_S = np.geomspace(0.02, 0.8, 36)
MAX_GAP_S = 0.15  # after a longer interval telemetry is missing
MIN_COUNTS = 4  # a tick with fewer may contain a stop or a reversal
MIN_TURN_TICKS = 60.0
MIN_TURN_RAD_S = 0.6  # half difference of the sides: above it the tyres slide
K, P, C, D, DELTA = range(5)
# Information without data, in squared units of the regressors: it bounds what the drive does not excite. It
# is weak enough for a dead motor: with one of three, the sides differ by delta = 0.2. The 100 of p weighs
# as much as ticks whose squared ud [PWM^2] sum to 100.
MEAN_PRIOR = (1.0, 100.0, 1e-3, 0.05, 0.2)  # of K, P, C, D, DELTA
TURN_PRIOR = (1.0, 100.0, 1e-3, 0.05, 0.2, 1e-3)  # in the same order, and m
# What the model leaves out: the voltage that sags within a tick, and its resolution. One standard deviation.
MODEL_GAIN, MODEL_TIME_CONSTANT, MODEL_FRICTION_PWM = 0.004, 0.02, 0.5


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
    # Torque of friction, left minus right, as the PWM at 7.4 V that gives it on a mean side. A weak bridge
    # needs more PWM for the same friction and does not change it. Only turns in place show it, or curves with
    # one side backward.
    drag_difference: Estimate | None = None
    gain_ratio: Estimate | None = None  # left to right; shown before the gain of each side is determined


NOTHING = WheelEstimate(gain=None, time_constant_s=None, friction=None)
MAX_STD = {"gain": 0.03, "time_constant": 0.10}  # two standard deviations, as shares of the value
MAX_FRICTION_STD_PWM = 2.0


class DriveTrainEstimator:
    """Takes one tick after the other, in bounded time and memory; `estimate` solves for the parameters."""

    def __init__(self, *, counts_per_rev: float, delay_s: float = 0.0) -> None:
        """`delay_s`: from a tick to its output, half a PWM period."""
        self._rad_per_count = 2.0 * math.pi / counts_per_rev
        self._last: WheelTick | None = None
        self._signs = (0.0, 0.0)
        self._turn = 0.0  # to the left, 1, to the right, -1, or neither
        self._mean = LagFit(BANK_S, MEAN_PRIOR, drives=2, delay_s=delay_s)
        self._difference = LagFit(BANK_S[::2], TURN_PRIOR, drives=2, delay_s=delay_s)

    def add(self, tick: WheelTick) -> None:
        """Add the next tick."""
        last, self._last = self._last, tick
        if last is None:
            return
        period_s = (tick.time_us - last.time_us) % 2**32 * 1e-6
        if not 0.0 < period_s <= MAX_GAP_S:
            self._mean.break_off()
            self._difference.break_off()
            return
        left = count_delta(last.left_count, tick.left_count)
        right = count_delta(last.right_count, tick.right_count)
        self._step(period_s, last, (left, right))

    def _step(self, period_s: float, start: WheelTick, counts: tuple[int, int]) -> None:
        signs = (float(np.sign(counts[0])), float(np.sign(counts[1])))
        scale, rad_s = 0.5 * start.battery_V / REFERENCE_V, 0.5 * self._rad_per_count / period_s
        um, ud = scale * (start.left_pwm + start.right_pwm), scale * (start.right_pwm - start.left_pwm)
        y, yd = rad_s * (counts[0] + counts[1]), rad_s * (counts[1] - counts[0])
        same, against = -0.5 * (signs[0] + signs[1]), -0.5 * (signs[1] - signs[0])
        # A bridge at PWM 0 coasts; a side that starts, stops or reverses has two frictions in one tick.
        driven = start.battery_V > 0.0 and start.left_pwm != 0 and start.right_pwm != 0
        good = driven and signs == self._signs and min(abs(counts[0]), abs(counts[1])) >= MIN_COUNTS
        turn = float(np.sign(yd)) if abs(yd) >= MIN_TURN_RAD_S else 0.0
        turns_on = good and turn != 0.0 and turn == self._turn
        self._signs, self._turn = signs, turn
        self._mean.step(period_s, (um, ud, same, against, -yd), y, good=good)
        self._difference.step(period_s, (ud, um, against, same, -y, -float(np.sign(yd))), yd, good=turns_on)

    def estimate(self) -> DriveTrainEstimate:
        """Return what the driving so far determines; takes about a millisecond."""
        fit = self._mean
        if fit.ticks < MIN_TICKS:
            return DriveTrainEstimate(mean=NOTHING, left=NOTHING, right=NOTHING)
        tau = _time_constant(fit.solve(), fit.independent_ticks())
        variance = fit.variance()
        squares, products = fit.at_minimum()
        information = (squares + np.diag(fit.prior)) / variance
        moment = products / variance
        if self._difference.ticks >= MIN_TURN_TICKS:
            self._difference.solve()
            shared = [P, D, DELTA]
            more, its_moment = self._difference.marginal(shared)
            information[np.ix_(shared, shared)] += more
            moment[shared] += its_moment
        covariance = np.linalg.inv(information).astype(np.float64)
        theta = covariance @ moment
        return DriveTrainEstimate(
            mean=_side(theta, covariance, tau, 0.0),
            left=_side(theta, covariance, tau, -1.0),
            right=_side(theta, covariance, tau, 1.0),
            drag_difference=_drag_difference(theta, covariance),
            gain_ratio=_gain_ratio(theta, covariance),
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
    per_damping = theta[K] + sign * theta[P]  # torque per PWM, over the mean damping
    damping = 1.0 + sign * theta[DELTA]  # over that of the mean
    if per_damping <= 0.0 or damping <= 0.0:
        return NOTHING
    gain, friction = per_damping / damping, (theta[C] + sign * theta[D]) / per_damping
    by_gain, by_friction = np.zeros_like(theta), np.zeros_like(theta)
    by_gain[[K, P, DELTA]] = np.array((1.0, sign, -sign * gain)) / damping
    by_friction[[K, P, C, D]] = np.array((-friction, -sign * friction, 1.0, sign)) / per_damping
    found_gain = Estimate(float(gain), math.hypot(_std(by_gain, covariance), MODEL_GAIN * float(gain)))
    found_friction = Estimate(float(friction), math.hypot(_std(by_friction, covariance), MODEL_FRICTION_PWM))
    lag = None
    if tau is not None:
        lag_s, spread = tau.value / float(damping), abs(sign) * math.sqrt(covariance[DELTA, DELTA])
        lag = Estimate(
            lag_s, lag_s * math.hypot(tau.std / tau.value, spread / float(damping), MODEL_TIME_CONSTANT)
        )
    return WheelEstimate(
        gain=found_gain if found_gain.within(MAX_STD["gain"]) else None,
        time_constant_s=lag if lag is not None and lag.within(MAX_STD["time_constant"]) else None,
        friction=found_friction if 2.0 * found_friction.std <= MAX_FRICTION_STD_PWM else None,
    )


def _drag_difference(theta: FloatArray, covariance: FloatArray) -> Estimate | None:
    """Return `((c - d) - (c + d)) / K`."""
    if theta[K] <= 0.0:
        return None
    value = -2.0 * theta[D] / theta[K]
    gradient = np.zeros_like(theta)
    gradient[[K, D]] = -value / theta[K], -2.0 / theta[K]
    return Estimate(float(value), _std(gradient, covariance))


def _gain_ratio(theta: FloatArray, covariance: FloatArray) -> Estimate | None:
    """Return `(K - p) / (1 - delta)`, left, over `(K + p) / (1 + delta)`, right."""
    left, right = theta[K] - theta[P], theta[K] + theta[P]
    left_damping, right_damping = 1.0 - theta[DELTA], 1.0 + theta[DELTA]
    if min(left, right, left_damping, right_damping) <= 0.0:
        return None
    value = float(left / left_damping / (right / right_damping))
    relative = np.zeros_like(theta)
    relative[K], relative[P] = 1.0 / left - 1.0 / right, -1.0 / left - 1.0 / right
    relative[DELTA] = 1.0 / left_damping + 1.0 / right_damping
    return Estimate(value, value * math.hypot(_std(relative, covariance), MODEL_GAIN))


def _std(gradient: FloatArray, covariance: FloatArray) -> float:
    return math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
