"""Pitch of the body on its springs.

The body is a mass on a spring with a damper (Rajamani, "Vehicle Dynamics and Control", ch. 10, one degree of
freedom). Its equilibrium is proportional to the acceleration.
"""

import math

import numpy as np

from thumper_hil.effects.body_parts import body_parts
from thumper_hil.effects.preset import BodyEffects

SPRINGS = body_parts().springs


class Pitch:
    """Pitch angle over time, positive with the front down."""

    def __init__(self, effects: BodyEffects, seed: int) -> None:
        self._rad_per_m_s2 = math.radians(effects.pitch_deg_per_m_s2)
        self._noise_rad = math.radians(effects.pitch_noise_deg)
        self._rng = np.random.default_rng([seed, 0x517C])
        self._angle_rad = self._rate_rad_s = self._shake_rad = 0.0
        self._speed_m_s = 0.0

    @property
    def is_level(self) -> bool:
        """Whether this body never pitches."""
        return self._rad_per_m_s2 == 0.0 and self._noise_rad == 0.0

    def step(self, speed_m_s: float, elapsed_s: float) -> float:
        """Advance to a new forward speed; return the pitch [rad]."""
        if self.is_level:
            return 0.0
        acceleration_m_s2 = (speed_m_s - self._speed_m_s) / elapsed_s
        self._speed_m_s = speed_m_s
        omega = math.tau * SPRINGS.natural_Hz
        target_rad = -self._rad_per_m_s2 * acceleration_m_s2
        pull = omega * omega * (target_rad - self._angle_rad)
        pull -= 2.0 * SPRINGS.damping * omega * self._rate_rad_s
        self._rate_rad_s += pull * elapsed_s
        self._angle_rad += self._rate_rad_s * elapsed_s
        if speed_m_s != 0.0:  # a resting robot does not shake
            keep = math.exp(-elapsed_s / SPRINGS.shake_time_s)
            spread = self._noise_rad * math.sqrt(1.0 - keep * keep)
            self._shake_rad = keep * self._shake_rad + spread * self._rng.standard_normal()
        else:
            self._shake_rad = 0.0
        return self._angle_rad + self._shake_rad
