"""PI tuning rules. All return Kp [PWM/(rad/s)] and Ki [PWM/(rad/s) per tick] of the board's control law."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.errors import ThumperError
from thumper_tuning.design.fast_sensitivity import max_sensitivity
from thumper_tuning.design.plant import Plant
from thumper_tuning.identify.model import MotorModel


@dataclass(frozen=True, slots=True, kw_only=True)
class PiGains:
    """kp [PWM/(rad/s)], ki [PWM/(rad/s) per tick]."""

    kp: float
    ki: float


KI_BACK_OFF = 0.97  # the maximum of Ki is flat: slightly below it a larger Kp settles sooner
GRID_ROUNDS, GRID_POINTS = 3, 13
BISECTIONS = 16


def migo(plant: Plant, sensitivity_limit: float) -> PiGains:
    """Return the gains with the largest Ki whose Ms stays within the limit.

    This is MIGO (Astrom, Panagopoulos and Hagglund, "Design of PI controllers based on non-convex
    optimization", Automatica 34 (5), 1998), here for the exact discrete plant. The maximum over Kp is flat:
    3 % of Ki are given up for the largest Kp within the limit, which damps the step response.
    """
    if sensitivity_limit <= 1.0:
        raise ThumperError(
            f"no loop reaches an Ms of {sensitivity_limit:g}; use more than 1, usually 1.4 to 2"
        )
    dc_gain = sum(plant.numerator) / (1.0 - plant.pole)
    low, high = 0.0, 4.0 / (dc_gain * (1.0 - plant.pole))
    best = PiGains(kp=0.0, ki=0.0)
    for _ in range(GRID_ROUNDS):  # each round refines the grid around the best Kp
        candidates = [
            PiGains(kp=float(kp), ki=_largest_ki(plant, float(kp), sensitivity_limit))
            for kp in np.linspace(low, high, GRID_POINTS)
        ]
        best = max(candidates, key=lambda gains: gains.ki)
        width = (high - low) / (GRID_POINTS - 1.0)
        low, high = max(best.kp - width, 0.0), best.kp + width
    ki = KI_BACK_OFF * best.ki
    kp = _bisect(
        best.kp,
        2.0 * best.kp + 1.0 / dc_gain,
        lambda kp: max_sensitivity(plant, kp, ki) <= sensitivity_limit,
    )
    return PiGains(kp=kp, ki=ki)


def _largest_ki(plant: Plant, kp: float, limit: float) -> float:
    high = 4.0 * (1.0 - plant.pole) / sum(plant.numerator)
    if max_sensitivity(plant, kp, 1e-4 * high) > limit:
        return 0.0
    return _bisect(0.0, high, lambda ki: max_sensitivity(plant, kp, ki) <= limit)


def _bisect(low: float, high: float, holds: Callable[[float], bool]) -> float:
    """Return the largest value for which the condition holds, given that it holds at `low`."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _dead_time(model: MotorModel, period_s: float) -> float:
    """Return the loop's dead time for a continuous rule: delay plus one period of counting and holding."""
    return model.delay_s + period_s


def improved_simc(model: MotorModel, period_s: float) -> PiGains:
    """Return the improved SIMC gains (Grimholt and Skogestad, 2012): tau + theta/3, and tc = theta."""
    theta = _dead_time(model, period_s)
    tau = model.time_constant_s + theta / 3.0
    return _simc(model.gain, tau, theta, period_s)


def simc(model: MotorModel, period_s: float) -> PiGains:
    """Return the SIMC gains (Skogestad, 2003), tc = theta."""
    return _simc(model.gain, model.time_constant_s, _dead_time(model, period_s), period_s)


def _simc(gain: float, tau: float, theta: float, period_s: float) -> PiGains:
    """Return Kp = tau / (K 2 theta) and Ti = min(tau, 8 theta)."""
    kp = tau / (gain * 2.0 * theta)
    return PiGains(kp=kp, ki=kp * period_s / min(tau, 8.0 * theta))


def amigo(model: MotorModel, period_s: float) -> PiGains:
    """Return the AMIGO gains (Astrom and Hagglund, 2004) for a first-order lag with dead time."""
    theta, tau = _dead_time(model, period_s), model.time_constant_s
    kp = (0.15 + (0.35 - theta * tau / (theta + tau) ** 2) * tau / theta) / model.gain
    integral_s = 0.35 * theta + 13.0 * theta * tau**2 / (tau**2 + 12.0 * theta * tau + 7.0 * theta**2)
    return PiGains(kp=kp, ki=kp * period_s / integral_s)


def ziegler_nichols(model: MotorModel, period_s: float) -> PiGains:
    """Return the gains of the step response method (Ziegler and Nichols, 1942), for comparison only."""
    theta = _dead_time(model, period_s)
    kp = 0.9 * model.time_constant_s / (model.gain * theta)
    return PiGains(kp=kp, ki=kp * period_s / (3.33 * theta))


def pole_placement(plant: Plant, natural_rad_s: float, damping: float) -> PiGains:
    """Return the gains that place one pole pair; the other poles are not constrained.

    At the pair's z, the characteristic equation kp + ki z/(z - 1) = -1/P(z) gives two real equations.
    """
    s = natural_rad_s * complex(-damping, math.sqrt(max(1.0 - damping**2, 0.0)))
    z = np.array([np.exp(s * plant.period_s)])
    ratio = -1.0 / plant.response(z)[0]
    integral = z[0] / (z[0] - 1.0)
    if abs(z[0].imag) < 1e-12:
        raise ThumperError("pole placement needs a complex pole pair: use a damping below 1")
    ki = ratio.imag / integral.imag
    return PiGains(kp=float(ratio.real - ki * integral.real), ki=float(ki))


RULES: dict[str, Callable[[MotorModel, float], PiGains]] = {
    "migo": lambda model, period_s: migo(Plant.from_model(model, period_s), 1.6),
    "migo-1.4": lambda model, period_s: migo(Plant.from_model(model, period_s), 1.4),
    "improved-simc": improved_simc,
    "simc": simc,
    "amigo": amigo,
    "ziegler-nichols": ziegler_nichols,
    "pole-placement": lambda model, period_s: pole_placement(
        Plant.from_model(model, period_s), 0.8 / period_s, 0.8
    ),
}
