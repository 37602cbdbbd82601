"""The wheel's speed loop as the board closes it: step response, frequency response, margins.

Plant, from the board's feed-forward: gain 1 / kv and time constant ka / kv, driven by a PWM that is constant
over a tick, measured as the mean speed of a tick: y[k+1] = a y[k] + c0 u[k] + c1 u[k-1]. Law: u[k] = kp e[k]
+ I[k], I[k] = I[k-1] + ki e[k].
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from thumper.common.geometry import FloatArray

PERIOD_S = 0.1  # of the firmware's control tick
STEP_S = 3.0
POINTS = 401
SLOWEST = 3e-3  # least frequency, of the Nyquist frequency


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopResponse:
    """Response of the PI alone, without feed-forward and limits."""

    stable: bool
    times_s: FloatArray
    step: FloatArray  # counted speed after a unit step of the set-point, one per tick
    frequencies_rad_s: FloatArray
    gain: FloatArray  # |L|
    phase_deg: FloatArray
    phase_margin_deg: float  # infinite: |L| never crosses 1
    gain_margin: float  # infinite: the phase never crosses -180 degrees
    rise_time_s: float  # 10 to 90 %, in whole ticks
    overshoot_percent: float
    sensitivity_peak: float  # Ms, the greatest |1 / (1 + L)|


@lru_cache(maxsize=8)  # one move of a slider asks twice for some gains, and always for those of the board
def loop_response(*, kp: float, ki: float, kv: float, ka: float, period_s: float = PERIOD_S) -> LoopResponse:
    """Return the response with these gains of the board, in their units; kv and ka must be positive."""
    c0, c1, a = _counted_plant(1.0 / kv, ka / kv, period_s)
    # Polynomials in 1/z.
    forward = np.convolve([kp + ki, -kp], [0.0, c0, c1])
    loop_denominator = np.convolve([1.0, -1.0], [1.0, -a, 0.0])
    closed = loop_denominator + forward
    stable = bool(np.all(np.abs(np.roots(closed)) < 1.0 - 1e-9))
    frequencies = np.geomspace(SLOWEST, 0.9999, POINTS) * math.pi / period_s
    delay = np.exp(-1j * frequencies * period_s)
    L = np.polyval(forward[::-1], delay) / np.polyval(loop_denominator[::-1], delay)
    gain, phase_deg = np.abs(L), np.degrees(np.unwrap(np.angle(L)))
    phase_deg -= 360.0 * np.round((phase_deg[0] + 90.0) / 360.0)  # it starts at the integrator's -90
    gain_margin = math.exp(-_at_crossing(phase_deg + 180.0, np.log(gain), otherwise=-math.inf))
    at_nyquist = -float(np.polyval(forward[::-1], -1.0) / np.polyval(loop_denominator[::-1], -1.0))
    if at_nyquist > 0.0:  # the loop is real and negative there
        gain_margin = min(gain_margin, 1.0 / at_nyquist)
    step = _step(closed, forward, round(STEP_S / period_s))
    reached = step.max() >= 0.9 and stable
    return LoopResponse(
        stable=stable,
        times_s=np.arange(len(step), dtype=np.float64) * period_s,
        step=step,
        frequencies_rad_s=frequencies,
        gain=gain,
        phase_deg=phase_deg,
        phase_margin_deg=_at_crossing(np.log(gain), 180.0 + phase_deg),
        gain_margin=gain_margin,
        rise_time_s=period_s * int(np.argmax(step >= 0.9) - np.argmax(step >= 0.1)) if reached else math.inf,
        overshoot_percent=max(0.0, 100.0 * (float(step.max()) - 1.0)),
        sensitivity_peak=float(np.max(1.0 / np.abs(1.0 + L))),
    )


def _counted_plant(gain: float, time_constant_s: float, period_s: float) -> tuple[float, float, float]:
    """Return c0, c1 and a of a first-order lag whose speed is averaged over each tick."""
    a = math.exp(-period_s / time_constant_s)
    mean = time_constant_s / period_s * (1.0 - a)
    return gain * (1.0 - mean), gain * (mean - a), a


def _step(closed: FloatArray, forward: FloatArray, ticks: int) -> FloatArray:
    """Return the output of forward / closed, polynomials in 1/z, after a unit step at tick 0."""
    y = np.zeros(ticks + 1)
    for k in range(ticks + 1):
        driven = sum(forward[: k + 1])
        fed_back = sum(closed[i] * y[k - i] for i in range(1, min(k, len(closed) - 1) + 1))
        y[k] = min(max(driven - fed_back, -1e6), 1e6)  # an unstable loop grows without limit
    return y


def _at_crossing(falls: FloatArray, wanted: FloatArray, otherwise: float = math.inf) -> float:
    """Return `wanted`, interpolated, where `falls` first becomes negative; `otherwise` if it never does."""
    below = np.flatnonzero((falls[:-1] >= 0.0) & (falls[1:] < 0.0))
    if not below.size:
        return otherwise
    k = int(below[0])
    share = falls[k] / (falls[k] - falls[k + 1])
    return float(wanted[k] + share * (wanted[k + 1] - wanted[k]))
