"""Fast stability and maximum sensitivity of a PI loop, for searches that need thousands of them.

`loops.SpeedLoop` computes the same with python-control in 10 ms; a test holds both equal on random plants.
"""

import math

import numpy as np

from thumper_tuning.design.plant import ComplexArray, Plant

FREQUENCIES = np.concatenate((np.geomspace(1e-3, 0.3, 80), np.linspace(0.3, math.pi, 240)))  # [rad/tick]
UNIT_CIRCLE = np.exp(1j * FREQUENCIES)
INTEGRATOR = UNIT_CIRCLE / (UNIT_CIRCLE - 1.0)


def max_sensitivity(plant: Plant, kp: float, ki: float) -> float:
    """Return Ms, the maximum of |1 / (1 + L)|, on a grid of 320 frequencies; infinite if unstable."""
    if not is_stable(plant, kp, ki):
        return math.inf
    L = plant.response(UNIT_CIRCLE) * (kp + ki * INTEGRATOR)
    return float(1.0 / np.min(np.abs(1.0 + L)))


def is_stable(plant: Plant, kp: float, ki: float) -> bool:
    """Return whether all closed-loop poles are inside the unit circle."""
    return bool(np.all(np.abs(closed_loop_poles(plant, kp, ki)) < 1.0 - 1e-9))


def closed_loop_poles(plant: Plant, kp: float, ki: float) -> ComplexArray:
    """Return the zeros of (z - 1)(z - a) z^(n-1) + ((Kp + Ki) z - Kp)(c0 z^(n-1) + c1 z^(n-2) + ...)."""
    denominator = np.polymul(
        np.polymul((1.0, -1.0), (1.0, -plant.pole)), [1.0] + [0.0] * (len(plant.numerator) - 1)
    )
    return np.roots(np.polyadd(denominator, np.polymul((kp + ki, -kp), plant.numerator))).astype(
        np.complex128
    )
