"""Analysis of the PI loop on the exact discrete plant: stability, sensitivity, margins, step response.

Plant: y[k+1] = a y[k] + c0 u[k] + c1 u[k-1] + ...; control law of the board: u[k] = Kp e[k] + I[k],
I[k] = I[k-1] + Ki e[k].
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
    """A wheel, from PWM to the speed that the board counts once per tick."""

    pole: float
    numerator: tuple[float, ...]  # c0, c1, ... [rad/s per PWM]
    period_s: float

    @classmethod
    def from_model(cls, model: MotorModel, period_s: float) -> "Plant":
        """Return the exact discrete plant of a motor."""
        pole, numerator = model.discretize(period_s)
        return cls(pole=pole, numerator=tuple(numerator.tolist()), period_s=period_s)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return the frequency response at points of the unit circle."""
        numerator = np.zeros_like(z)
        for k, coefficient in enumerate(self.numerator):
            numerator = numerator + coefficient * z ** (-1 - k)
        result: ComplexArray = numerator / (1.0 - self.pole / z)
        return result


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """Stability margins of a loop. The distance 1 / Ms to -1 is the S-based disk margin."""

    stable: bool
    max_sensitivity: float  # Ms, the maximum of |1 / (1 + L)|; infinite if unstable
    max_complementary: float  # Mt, the maximum of |L / (1 + L)|
    gain_margin: float  # factor
    phase_margin_deg: float
    delay_margin_s: float


UNSTABLE = LoopMargins(
    stable=False,
    max_sensitivity=math.inf,
    max_complementary=math.inf,
    gain_margin=0.0,
    phase_margin_deg=0.0,
    delay_margin_s=0.0,
)


def loop_margins(plant: Plant, kp: float, ki: float) -> LoopMargins:
    """Return the margins, on a grid of 320 frequencies; stability is decided by the closed-loop poles."""
    if not is_stable(plant, kp, ki):
        return UNSTABLE
    L = loop_response(plant, kp, ki)
    S = 1.0 / np.abs(1.0 + L)
    phase = np.unwrap(np.angle(L))
    gain_margin = math.inf
    crossings = np.flatnonzero((phase[:-1] > -math.pi) & (phase[1:] <= -math.pi))
    if len(crossings):
        gain_margin = float(1.0 / np.abs(L[crossings[0] + 1]))
    elif abs(phase[-1] + math.pi) < 0.05:
        gain_margin = float(1.0 / np.abs(L[-1]))
    crossover = np.flatnonzero((np.abs(L[:-1]) >= 1.0) & (np.abs(L[1:]) < 1.0))
    phase_margin = float(math.pi + phase[crossover[-1]]) if len(crossover) else math.pi
    delay = phase_margin / FREQUENCIES[crossover[-1]] * plant.period_s if len(crossover) else math.inf
    return LoopMargins(
        stable=True,
        max_sensitivity=float(S.max()),
        max_complementary=float(np.max(np.abs(L) * S)),
        gain_margin=gain_margin,
        phase_margin_deg=math.degrees(phase_margin),
        delay_margin_s=float(delay),
    )


def max_sensitivity(plant: Plant, kp: float, ki: float) -> float:
    """Return Ms alone; infinite if the loop is unstable."""
    if not is_stable(plant, kp, ki):
        return math.inf
    return float(1.0 / np.min(np.abs(1.0 + loop_response(plant, kp, ki))))


def loop_response(plant: Plant, kp: float, ki: float) -> ComplexArray:
    """Return the loop transfer function L = C P at `FREQUENCIES`."""
    result: ComplexArray = plant.response(UNIT_CIRCLE) * (kp + ki * INTEGRATOR)
    return result


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


def transfer_functions(
    plant: Plant, kp: float, ki: float
) -> "tuple[control.TransferFunction, control.TransferFunction]":
    """Return plant and controller as python-control transfer functions."""
    import control

    zeros = [0.0] * (len(plant.numerator) - 1)
    return (
        control.tf(list(plant.numerator), np.polymul((1.0, -plant.pole), [1.0, *zeros]), plant.period_s),
        control.tf([kp + ki, -kp], [1.0, -1.0], plant.period_s),
    )


def step_response(plant: Plant, kp: float, ki: float, ticks: int, *, load: float = 0.0) -> FloatArray:
    """Return the counted speed after a unit step of the set-point, or after a load step of `load` [PWM]."""
    y = np.zeros(ticks + 1)
    u = np.zeros(ticks + 1)
    integral, setpoint = 0.0, 0.0 if load else 1.0
    for k in range(ticks):
        error = setpoint - y[k]
        integral += ki * error
        u[k] = kp * error + integral - load
        y[k + 1] = plant.pole * y[k] + sum(c * u[k - i] for i, c in enumerate(plant.numerator) if k >= i)
    return y


@dataclass(frozen=True, slots=True, kw_only=True)
class StepInfo:
    """Characteristics of the linear response to a unit step of the set-point."""

    rise_time_s: float  # to 90 %
    settling_time_s: float  # to within 2 %
    overshoot_percent: float
    itae: float  # integral of time times absolute error [s^2]


def step_info(plant: Plant, kp: float, ki: float, duration_s: float = 6.0) -> StepInfo:
    """Return the characteristics of the step response, sampled once per tick."""
    y = step_response(plant, kp, ki, round(duration_s / plant.period_s))
    outside = np.flatnonzero(np.abs(y - 1.0) > 0.02)
    time_s = np.arange(len(y)) * plant.period_s
    risen = np.flatnonzero(y >= 0.9)
    return StepInfo(
        rise_time_s=float(time_s[risen[0]]) if len(risen) else math.inf,
        settling_time_s=float(time_s[min(outside[-1] + 1, len(y) - 1)]) if len(outside) else 0.0,
        overshoot_percent=100.0 * max(float(y.max()) - 1.0, 0.0),
        itae=float(np.sum(time_s * np.abs(1.0 - y)) * plant.period_s),
    )
