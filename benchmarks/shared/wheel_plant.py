"""A simulated wheel to identify, independent of the product: small fixed steps, no closed forms."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel

COUNT_RAD = math.tau / 1200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheel:
    """The middle wheel of a Wild Thumper on the ground at 7.4 V, with torque ripple of 2 % of the speed."""

    gain: float = 0.0584  # [rad/s per PWM]
    tau_s: float = 0.075
    friction: float = 19.3  # [PWM]
    static_ratio: float = 1.4
    delay_s: float = 0.001
    ripple: float = 2.7  # [PWM], standard deviation, correlated over 20 ms

    def drive(self, time_s: FloatArray, pwm: FloatArray, seed: int) -> FloatArray:
        """Return the angles [rad] at the rows, from rest; `pwm[k]` acts from row k to the next."""
        step_s = 0.0005
        fine_s = np.arange(time_s[0], time_s[-1], step_s)
        at = np.clip(np.searchsorted(time_s, fine_s - self.delay_s, side="right") - 1, -1, len(pwm) - 1)
        delayed = np.where(at >= 0, pwm[at], 0.0)
        noise = np.random.default_rng(seed).standard_normal(len(fine_s))
        parameters = _Parameters(self.gain, self.tau_s, self.friction, self.static_ratio, self.ripple)
        angle = _integrate(delayed, noise, step_s, parameters)
        at_rows: FloatArray = np.interp(time_s, np.append(fine_s, fine_s[-1] + step_s), angle)
        return at_rows


def counted(angle_rad: FloatArray, counts_per_rev: float = 1200.0) -> FloatArray:
    """Return the counts of an encoder."""
    return np.floor(angle_rad * counts_per_rev / math.tau)


def steps_and_prbs(rows: int, seed: int) -> FloatArray:
    """Return stairs in both directions, then two-level noise on each side of the dead band, shape (rows,)."""
    rng = np.random.default_rng(seed)
    stairs = np.repeat((60, 120, 200, 0, -60, -120, -200, 0, 100, 0, -150, 0), 12)
    rest: list[int] = []
    while len(rest) < rows - len(stairs):
        side = 1 if (len(rest) // 100) % 2 == 0 else -1
        rest += [side * (80 if rng.random() < 0.5 else 180)] * int(rng.integers(1, 4))
    return np.concatenate((stairs, rest)).astype(float)[:rows]


class _Parameters(NamedTuple):
    gain: float
    tau_s: float
    friction: float
    static_ratio: float
    ripple: float


@kernel
def _integrate(pwm: FloatArray, noise: FloatArray, h: float, wheel: _Parameters) -> FloatArray:
    gain, tau, friction, static_ratio, ripple = wheel
    angle = np.zeros(len(pwm) + 1)
    omega, disturbance = 0.0, 0.0
    for i in range(len(pwm)):
        disturbance += -disturbance * h / 0.02 + ripple * math.sqrt(2.0 * h / 0.02) * noise[i]
        before = omega
        if omega == 0.0:
            if abs(pwm[i]) > static_ratio * friction:
                omega = h / tau * gain * (pwm[i] - math.copysign(friction, pwm[i]))
        else:
            sign = math.copysign(1.0, omega)
            omega += h / tau * (gain * (pwm[i] - sign * friction + disturbance) - omega)
            if omega * sign < 0.0:
                omega = 0.0
        angle[i + 1] = angle[i] + 0.5 * (before + omega) * h
    return angle
