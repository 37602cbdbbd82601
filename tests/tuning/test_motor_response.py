"""The simulation in closed form against small steps, and the discrete plant against the simulation."""

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import Wheel

from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import DriveSignal, MotorParameters, simulate
from thumper_tuning.identify.richer_models import ExtraParameters, simulate_richer


@pytest.mark.parametrize("delay_s", [0.0, 0.013, 0.17])
def test_starts_stops_and_reversals_are_exact(delay_s: float) -> None:
    time_s = np.array([0.0, 0.31, 0.7, 0.9, 1.4, 1.6, 2.1, 2.2, 3.0])
    pwm = np.array([120.0, -60.0, 10.0, 200.0, 0.0, -180.0, 180.0, -25.0, 0.0])
    wheel = Wheel(ripple=0.0, delay_s=delay_s)
    expected = wheel.drive(time_s, pwm, 0)
    motor = MotorParameters(wheel.gain, wheel.tau_s, 19.3, 19.3, wheel.static_ratio, delay_s)
    angles, _ = simulate(DriveSignal(time_s, pwm, 0.0), time_s, 0.0, motor)
    assert angles == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("delay_s", [0.0, 0.04, 0.13])
def test_the_discrete_plant_is_the_counted_response(delay_s: float) -> None:
    """y[k+1] = a y[k] + c0 u[k] + ... equals the counts of the continuous response."""
    model = MotorModel(
        gain=0.06, time_constant_s=0.08, friction_forward=0.0, friction_backward=0.0, delay_s=delay_s
    )
    period_s = 0.1
    rng = np.random.default_rng(0)
    u = rng.uniform(50.0, 200.0, 40)
    time_s = np.arange(41, dtype=float) * period_s
    motor = MotorParameters(0.06, 0.08, 0.0, 0.0, 1.0, delay_s)
    angles, _ = simulate(DriveSignal(time_s[:-1], u, 0.0), time_s, 0.0, motor)
    counted = np.diff(angles) / period_s
    a, numerator = model.discretize(period_s)
    y = np.zeros(41)
    for k in range(40):
        y[k + 1] = a * y[k] + sum(c * u[k - i] for i, c in enumerate(numerator) if k >= i)
    assert y[1:] == pytest.approx(counted, abs=1e-9)


def test_without_delay_the_numerator_is_that_of_the_derivation() -> None:
    """c0 = K (1 - b), c1 = K (b - a), a = exp(-T/tau), b = (1 - a) tau / T."""
    model = MotorModel(gain=2.0, time_constant_s=0.075, friction_forward=0.0, friction_backward=0.0)
    a, numerator = model.discretize(0.1)
    b = (1.0 - a) * 0.75
    assert a == pytest.approx(np.exp(-0.1 / 0.075))
    assert numerator == pytest.approx([2.0 * (1.0 - b), 2.0 * (b - a)])


def test_a_richer_model_without_extras_is_the_first_order_model() -> None:
    time_s = np.arange(0.0, 4.0, 0.1)
    pwm = np.where(time_s < 1.0, 150.0, np.where(time_s < 2.0, 0.0, -90.0))
    signal, motor = DriveSignal(time_s, pwm, 0.0), MotorParameters(0.0584, 0.1, 19.0, 19.0, 1.0, 0.02)
    plain, _ = simulate(signal, time_s, 0.0, motor)
    richer, _ = simulate_richer(signal, time_s, 0.0, motor, ExtraParameters(0.0, 0.0, 1.0))
    assert richer == pytest.approx(plain, abs=0.02)
