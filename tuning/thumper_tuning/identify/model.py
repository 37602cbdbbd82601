"""The identified motor model: one pole, Coulomb friction per direction, dead time."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorModel:
    """tau dw/dt + w = gain (u(t - delay) - friction sign(w)) in motion; at rest inside the dead band.

    u is in the log's drive unit, PWM or volts. A friction can come out negative if the motor driver maps
    commands to voltage nonlinearly. It is then the offset of that map, not friction.
    """

    gain: float  # [rad/s per drive unit]
    time_constant_s: float
    friction_forward: float  # [drive unit]
    friction_backward: float  # [drive unit]
    delay_s: float = 0.0
    breakaway_ratio: float = 1.0  # break-away over running friction

    @property
    def friction(self) -> float:
        """Mean of both directions [drive unit]."""
        return 0.5 * (self.friction_forward + self.friction_backward)

    def discretize(self, period_s: float) -> tuple[float, FloatArray]:
        """Return a and c of y[k+1] = a y[k] + c[0] u[k] + c[1] u[k-1] + ... for a zero-order hold on u.

        y[k+1] is the mean speed between the ticks k and k+1: what an encoder counts. There are two
        coefficients c without dead time, three up to one period of it (derivations.md, "The counted plant").
        """
        return discretize_lag(self.gain, self.time_constant_s, self.delay_s, period_s)


def discretize_lag(
    gain: float, time_constant_s: float, delay_s: float, period_s: float
) -> tuple[float, FloatArray]:
    """Return pole a and coefficients c of a counted first-order lag; see `MotorModel.discretize`."""
    a = math.exp(-period_s / time_constant_s)
    order = 2 + math.ceil(delay_s / period_s - 1e-9)
    ends_s = np.maximum(np.arange(order + 1) * period_s - delay_s, 0.0)
    turned_rad = gain * (ends_s - time_constant_s * -np.expm1(-ends_s / time_constant_s))
    step = np.diff(turned_rad) / period_s  # counted response to a unit step
    pulse = np.diff(step, prepend=0.0)
    return a, pulse - a * np.concatenate(([0.0], pulse[:-1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """One standard deviation of each parameter, in the unit of the parameter."""

    gain: float
    time_constant_s: float
    friction: float
    delay_s: float
    friction_forward: float
    friction_backward: float
    sensor_window_s: float = 0.0  # of the averaging time of the logged speeds; 0: of counts
    delay_with_window_s2: float = 0.0  # the covariance of both
