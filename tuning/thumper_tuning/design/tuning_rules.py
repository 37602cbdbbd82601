"""PI gains by rule. All return Kp [PWM/(rad/s)] and Ki [PWM/(rad/s) a tick] of the board's law."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.errors import ThumperError
from thumper_tuning.design.loop_analysis import Plant, sensitivity
from thumper_tuning.identify.model import MotorModel


@dataclass(frozen=True, slots=True, kw_only=True)
class PiGains:
    """kp [PWM/(rad/s)], ki [PWM/(rad/s) a tick]."""

    kp: float
    ki: float


BACK_OFF = 0.97  # of the largest Ki: its peak is flat, and just below it more Kp settles sooner


def migo(plant: Plant, largest_sensitivity: float) -> PiGains:
    """The largest Ki whose Ms stays within the limit (Astrom and Hagglund's MIGO, here on the exact plant).

    The peak over Kp is flat: 3 % of Ki are given for the largest Kp that the limit then allows, which damps
    the answer to a step.
    """
    if largest_sensitivity <= 1.0:
        raise ThumperError(
            f"no loop has an Ms of {largest_sensitivity:g}; give more than 1, usually 1.4 to 2"
        )
    static = sum(plant.taps) / (1.0 - plant.pole)
    low, high = 0.0, 4.0 / (static * (1.0 - plant.pole))
    best = PiGains(kp=0.0, ki=0.0)
    for _ in range(3):  # each round looks closer round the best Kp
        grid = np.linspace(low, high, 13)
        found = [PiGains(kp=float(kp), ki=_largest_ki(plant, float(kp), largest_sensitivity)) for kp in grid]
        best = max(found, key=lambda gains: gains.ki)
        width = (high - low) / 12.0
        low, high = max(best.kp - width, 0.0), best.kp + width
    ki = BACK_OFF * best.ki
    kp = _bisect(
        best.kp, 2.0 * best.kp + 1.0 / static, lambda kp: sensitivity(plant, kp, ki) <= largest_sensitivity
    )
    return PiGains(kp=kp, ki=ki)


def _largest_ki(plant: Plant, kp: float, limit: float) -> float:
    high = 4.0 * (1.0 - plant.pole) / sum(plant.taps)
    if sensitivity(plant, kp, 1e-4 * high) > limit:
        return 0.0
    return _bisect(0.0, high, lambda ki: sensitivity(plant, kp, ki) <= limit)


def _bisect(low: float, high: float, holds: Callable[[float], bool]) -> float:
    """The largest value for which it holds, given that it does at `low`."""
    for _ in range(16):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _dead_time(model: MotorModel, period_s: float) -> float:
    """What a continuous rule takes for the loop's dead time: the delay, and a whole period of counting
    and holding."""
    return model.delay_s + period_s


def improved_simc(model: MotorModel, period_s: float) -> PiGains:
    """Skogestad's SIMC as improved by Grimholt (2012): tau + theta/3, and tc = theta."""
    theta = _dead_time(model, period_s)
    lag = model.time_constant_s + theta / 3.0
    kp = lag / (model.gain * 2.0 * theta)
    return PiGains(kp=kp, ki=kp * period_s / min(lag, 8.0 * theta))


def simc(model: MotorModel, period_s: float) -> PiGains:
    """Skogestad's SIMC (2003), tc = theta."""
    theta = _dead_time(model, period_s)
    kp = model.time_constant_s / (model.gain * 2.0 * theta)
    return PiGains(kp=kp, ki=kp * period_s / min(model.time_constant_s, 8.0 * theta))


def amigo(model: MotorModel, period_s: float) -> PiGains:
    """Astrom and Hagglund's AMIGO (2004) for a lag with dead time."""
    theta, tau = _dead_time(model, period_s), model.time_constant_s
    kp = (0.15 + (0.35 - theta * tau / (theta + tau) ** 2) * tau / theta) / model.gain
    integral_s = 0.35 * theta + 13.0 * theta * tau**2 / (tau**2 + 12.0 * theta * tau + 7.0 * theta**2)
    return PiGains(kp=kp, ki=kp * period_s / integral_s)


def ziegler_nichols(model: MotorModel, period_s: float) -> PiGains:
    """Ziegler and Nichols's step rule (1942), for comparison only."""
    theta = _dead_time(model, period_s)
    kp = 0.9 * model.time_constant_s / (model.gain * theta)
    return PiGains(kp=kp, ki=kp * period_s / (3.33 * theta))


def pole_placement(plant: Plant, natural_rad_s: float, damping: float) -> PiGains:
    """Put the dominant pair where a second-order loop has it; the rest of the poles falls where it may.

    At the pair's z the characteristic equation gives two real conditions for the two gains.
    """
    s = natural_rad_s * complex(-damping, math.sqrt(max(1.0 - damping**2, 0.0)))
    z = np.array([np.exp(s * plant.period_s)])
    ratio = -1.0 / plant.response(z)[0]
    integral = z[0] / (z[0] - 1.0)
    if abs(z[0].imag) < 1e-12:
        raise ThumperError("pole placement needs a complex pair: give a damping below 1")
    ki = ratio.imag / integral.imag
    return PiGains(kp=float(ratio.real - ki * integral.real), ki=float(ki))


RULES: dict[str, Callable[[MotorModel, float], PiGains]] = {
    "migo": lambda model, period_s: migo(Plant.of(model, period_s), 1.6),
    "migo-1.4": lambda model, period_s: migo(Plant.of(model, period_s), 1.4),
    "improved-simc": improved_simc,
    "simc": simc,
    "amigo": amigo,
    "ziegler-nichols": ziegler_nichols,
    "pole-placement": lambda model, period_s: pole_placement(Plant.of(model, period_s), 0.8 / period_s, 0.8),
}
