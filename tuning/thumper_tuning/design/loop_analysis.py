"""The PI loop on the exact discrete plant: stability, sensitivity, margins. Pure numbers; `transfer`
for python-control.

Plant: y[k+1] = a y[k] + c0 u[k] + c1 u[k-1] + ...; law of the board: u[k] = Kp e[k] + I[k], I[k] =
I[k-1] + Ki e[k].
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel

if TYPE_CHECKING:
    import control

ComplexArray = NDArray[np.complex128]

FREQUENCIES = np.concatenate((np.geomspace(1e-3, 0.3, 80), np.linspace(0.3, math.pi, 240)))  # [rad/tick]
UNIT_CIRCLE = np.exp(1j * FREQUENCIES)
INTEGRATOR = UNIT_CIRCLE / (UNIT_CIRCLE - 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A wheel as the board counts it once a tick."""

    pole: float
    taps: tuple[float, ...]  # c0, c1, ... [rad/s per PWM]
    period_s: float

    @classmethod
    def of(cls, model: MotorModel, period_s: float) -> "Plant":
        """The exact discrete plant of a motor."""
        pole, taps = model.taps(period_s)
        return cls(pole=pole, taps=tuple(taps.tolist()), period_s=period_s)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Frequency response at points of the unit circle."""
        numerator = np.zeros_like(z)
        for k, tap in enumerate(self.taps):
            numerator = numerator + tap * z ** (-1 - k)
        result: ComplexArray = numerator / (1.0 - self.pole / z)
        return result


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopFigures:
    """How well a loop is damped and how much it forgives."""

    stable: bool
    sensitivity: float  # Ms, the largest |1 / (1 + L)|; infinite if not stable
    complementary: float  # Mt
    gain_margin: float  # factor
    phase_margin_deg: float
    delay_margin_s: float


def judge(plant: Plant, kp: float, ki: float) -> LoopFigures:
    """Stability by the closed loop's poles; margins on a grid of 320 frequencies."""
    if not is_stable(plant, kp, ki):
        return LoopFigures(
            stable=False,
            sensitivity=math.inf,
            complementary=math.inf,
            gain_margin=0.0,
            phase_margin_deg=0.0,
            delay_margin_s=0.0,
        )
    L = open_loop(plant, kp, ki)
    S = 1.0 / np.abs(1.0 + L)
    phase = np.unwrap(np.angle(L))
    gain_margin = math.inf
    crossings = np.flatnonzero((phase[:-1] > -math.pi) & (phase[1:] <= -math.pi))
    if len(crossings):
        gain_margin = float(1.0 / np.abs(L[crossings[0] + 1]))
    elif abs(phase[-1] + math.pi) < 0.05:
        gain_margin = float(1.0 / np.abs(L[-1]))
    above = np.flatnonzero((np.abs(L[:-1]) >= 1.0) & (np.abs(L[1:]) < 1.0))
    phase_margin = float(math.pi + phase[above[-1]]) if len(above) else math.pi
    delay = phase_margin / FREQUENCIES[above[-1]] * plant.period_s if len(above) else math.inf
    return LoopFigures(
        stable=True,
        sensitivity=float(S.max()),
        complementary=float(np.max(np.abs(L) * S)),
        gain_margin=gain_margin,
        phase_margin_deg=math.degrees(phase_margin),
        delay_margin_s=float(delay),
    )


def sensitivity(plant: Plant, kp: float, ki: float) -> float:
    """Ms alone; infinite where the loop is not stable."""
    if not is_stable(plant, kp, ki):
        return math.inf
    return float(1.0 / np.min(np.abs(1.0 + open_loop(plant, kp, ki))))


def open_loop(plant: Plant, kp: float, ki: float) -> ComplexArray:
    """L at `FREQUENCIES`."""
    result: ComplexArray = plant.response(UNIT_CIRCLE) * (kp + ki * INTEGRATOR)
    return result


def is_stable(plant: Plant, kp: float, ki: float) -> bool:
    """Whether all poles of the closed loop lie inside the unit circle."""
    return bool(np.all(np.abs(closed_loop_poles(plant, kp, ki)) < 1.0 - 1e-9))


def closed_loop_poles(plant: Plant, kp: float, ki: float) -> ComplexArray:
    """Zeros of (z - 1)(z - a) z^(n-1) + ((Kp + Ki) z - Kp)(c0 z^(n-1) + c1 z^(n-2) + ...)."""
    denominator = np.polymul(
        np.polymul((1.0, -1.0), (1.0, -plant.pole)), [1.0] + [0.0] * (len(plant.taps) - 1)
    )
    return np.roots(np.polyadd(denominator, np.polymul((kp + ki, -kp), plant.taps))).astype(np.complex128)


def transfer(
    plant: Plant, kp: float, ki: float
) -> "tuple[control.TransferFunction, control.TransferFunction]":
    """Plant and controller as python-control objects, to carry on with."""
    import control

    zeros = [0.0] * (len(plant.taps) - 1)
    return (
        control.tf(list(plant.taps), np.polymul((1.0, -plant.pole), [1.0, *zeros]), plant.period_s),
        control.tf([kp + ki, -kp], [1.0, -1.0], plant.period_s),
    )


def step_response(plant: Plant, kp: float, ki: float, ticks: int, *, load: float = 0.0) -> FloatArray:
    """Counted speed after a unit step of the set-point, or with `load` [PWM] of a step of the load
    instead."""
    y = np.zeros(ticks + 1)
    u = np.zeros(ticks + 1)
    integral, target = 0.0, 0.0 if load else 1.0
    for k in range(ticks):
        error = target - y[k]
        integral += ki * error
        u[k] = kp * error + integral - load
        y[k + 1] = plant.pole * y[k] + sum(tap * u[k - i] for i, tap in enumerate(plant.taps) if k >= i)
    return y


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFigures:
    """A step of the set-point, linear."""

    rise_s: float  # to 90 %
    settle_s: float  # into 2 %
    overshoot_percent: float
    itae: float  # [s^2]


def judge_step(plant: Plant, kp: float, ki: float, seconds: float = 6.0) -> StepFigures:
    """Figures of a unit step, counted once a tick."""
    y = step_response(plant, kp, ki, round(seconds / plant.period_s))
    outside = np.flatnonzero(np.abs(y - 1.0) > 0.02)
    time_s = np.arange(len(y)) * plant.period_s
    reached = np.flatnonzero(y >= 0.9)
    return StepFigures(
        rise_s=float(time_s[reached[0]]) if len(reached) else math.inf,
        settle_s=float(time_s[min(outside[-1] + 1, len(y) - 1)]) if len(outside) else 0.0,
        overshoot_percent=100.0 * max(float(y.max()) - 1.0, 0.0),
        itae=float(np.sum(time_s * np.abs(1.0 - y)) * plant.period_s),
    )
