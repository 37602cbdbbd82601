"""The identified motor as python-control systems: continuous, as the board counts it, and with friction.

python-control loads in 1 to 3 s, so it is imported inside the functions.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel, discretize_lag
from thumper_tuning.identify.motor_response import DriveSignal, motor_parameters, simulate

if TYPE_CHECKING:
    import control

PADE_ORDER = 3
NEGLIGIBLE = 0.01  # of the time constant: a shorter delay or second lag only makes the numbers stiff
SIGNALS = {"inputs": ["drive"], "outputs": ["speed"]}


def continuous_system(model: MotorModel) -> "control.TransferFunction":
    """Return K e^(-s d) / (tau s + 1) from drive to speed, without friction.

    The dead time is a Pade approximation of order 3: python-control's transfer functions have none.
    """
    return _delayed([model.gain], [model.time_constant_s, 1.0], _delay_s(model))


def _delay_s(model: MotorModel) -> float:
    return model.delay_s if model.delay_s > NEGLIGIBLE * model.time_constant_s else 0.0


def second_order_system(model: MotorModel, second_time_constant_s: float) -> "control.TransferFunction":
    """Return K e^(-s d) / ((tau s + 1)(tau2 s + 1)): the thesis's motor, eq. 3.3, without friction."""
    denominator = [model.time_constant_s, 1.0]
    if second_time_constant_s > NEGLIGIBLE * model.time_constant_s:
        denominator = np.polymul(denominator, [second_time_constant_s, 1.0]).tolist()
    return _delayed([model.gain], denominator, _delay_s(model))


def _delayed(numerator: list[float], denominator: list[float], delay_s: float) -> "control.TransferFunction":
    import control

    lag = control.tf(numerator, denominator)
    if delay_s > 0.0:
        lag = control.series(control.tf(*control.pade(delay_s, PADE_ORDER)), lag)
    return control.tf(lag, name="motor", **SIGNALS)


def counted_system(model: MotorModel, period_s: float) -> "control.TransferFunction":
    """Return the exact discrete system from drive to counted speed, with dead time, without friction."""
    return _counted_lag(model.gain, model.time_constant_s, model.delay_s, period_s)


def counted_second_order_system(
    model: MotorModel, second_time_constant_s: float, period_s: float
) -> "control.TransferFunction":
    """Return the exact discrete system of the second-order model: two first-order lags in parallel."""
    import control

    first_s, second_s = model.time_constant_s, second_time_constant_s
    if math.isclose(first_s, second_s, rel_tol=1e-4):
        second_s *= 1.0 + 1e-4  # equal lags have no partial fractions
    lags = [
        _counted_lag(model.gain * own_s / (own_s - other_s), own_s, model.delay_s, period_s)
        for own_s, other_s in ((first_s, second_s), (second_s, first_s))
    ]
    return control.tf(control.parallel(*lags), name="motor", **SIGNALS)


def _counted_lag(
    gain: float, time_constant_s: float, delay_s: float, period_s: float
) -> "control.TransferFunction":
    import control

    pole, numerator = discretize_lag(gain, time_constant_s, delay_s, period_s)
    denominator = [1.0, -pole, *[0.0] * (len(numerator) - 1)]
    return control.tf(numerator, denominator, period_s, name="motor", **SIGNALS)


def friction_system(model: MotorModel, period_s: float) -> "control.NonlinearIOSystem":
    """Return the motor with friction and dead time as a discrete nonlinear system, exact at the ticks.

    States: speed at the tick, counted speed, and the drives that are still on their way. Simulate it with
    `control.input_output_response`.
    """
    import control

    waiting = math.ceil(model.delay_s / period_s - 1e-9)  # earlier drives that act in this period
    motor = motor_parameters(model)
    ticks_s = np.array([0.0, period_s])
    starts_s = np.arange(-waiting, 1, dtype=float) * period_s

    def update(time_s: float, x: FloatArray, u: FloatArray, params: dict[str, Any]) -> FloatArray:
        drives = np.concatenate((x[2:], u))
        signal = DriveSignal(change_s=starts_s, drive=drives, initial=float(drives[0]))
        angles, speeds = simulate(signal, ticks_s, float(x[0]), motor)
        return np.concatenate(([speeds[1], angles[1] / period_s], drives[1:]))

    def output(time_s: float, x: FloatArray, u: FloatArray, params: dict[str, Any]) -> FloatArray:
        return x[1:2]

    return control.nlsys(update, output, states=2 + waiting, dt=period_s, name="motor", **SIGNALS)
