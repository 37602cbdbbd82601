"""The motor as it is identified: one pole, dry friction per direction, delay. Python-control objects
come out."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thumper.common.geometry import FloatArray

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorModel:
    """tau dw/dt + w = gain (u(t - delay) - friction sign(w)) while it turns; at rest until |u| breaks
    it away.

    u is in the log's drive unit, PWM or volts. Frictions may come out negative where a driver's map from
    command to voltage is bent; then they are no friction but the offset of that map.
    """

    gain: float  # [rad/s per drive unit]
    time_constant_s: float
    friction_forward: float  # [drive unit]
    friction_backward: float  # [drive unit]
    delay_s: float = 0.0
    breakaway_ratio: float = 1.0  # static over sliding friction

    @property
    def friction(self) -> float:
        """Both directions' mean [drive unit]."""
        return 0.5 * (self.friction_forward + self.friction_backward)

    def continuous(self) -> "control.TransferFunction":
        """Drive to speed without friction and delay: python-control has no dead time."""
        import control

        return control.tf([self.gain], [self.time_constant_s, 1.0])

    def discrete(self, period_s: float) -> "control.TransferFunction":
        """Drive to the speed counted over the period, exact, with the delay; see `taps`."""
        import control

        a, taps = self.taps(period_s)
        return control.tf(taps, [1.0, -a, *[0.0] * (len(taps) - 1)], period_s)

    def taps(self, period_s: float) -> tuple[float, FloatArray]:
        """Return a and c of y[k+1] = a y[k] + c[0] u[k] + c[1] u[k-1] + ... for a held u and a counted y.

        y[k+1] is the mean speed between the ticks k and k+1. Two taps without delay, three up to one period.
        """
        a = math.exp(-period_s / self.time_constant_s)
        order = 2 + math.ceil(self.delay_s / period_s - 1e-9)
        ends_s = np.maximum(np.arange(order + 1) * period_s - self.delay_s, 0.0)
        turned_rad = self.gain * (ends_s - self.time_constant_s * -np.expm1(-ends_s / self.time_constant_s))
        step = np.diff(turned_rad) / period_s  # counted response to a unit step
        pulse = np.diff(step, prepend=0.0)
        return a, pulse - a * np.concatenate(([0.0], pulse[:-1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """One standard deviation of each parameter, in the parameter's unit."""

    gain: float
    time_constant_s: float
    friction: float
    delay_s: float
    friction_forward: float
    friction_backward: float
