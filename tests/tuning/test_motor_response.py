"""The closed forms between events against small steps, and the taps against the closed forms."""

import numpy as np
import pytest

from tests.tuning.plant import Wheel
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import respond
from thumper_tuning.identify.richer_models import respond_two


@pytest.mark.parametrize("delay_s", [0.0, 0.013, 0.17])
def test_starts_stops_and_reversals_are_exact(delay_s: float) -> None:
    time_s = np.array([0.0, 0.31, 0.7, 0.9, 1.4, 1.6, 2.1, 2.2, 3.0])
    pwm = np.array([120.0, -60.0, 10.0, 200.0, 0.0, -180.0, 180.0, -25.0, 0.0])
    wheel = Wheel(ripple=0.0, delay_s=delay_s)
    expected = wheel.drive(time_s, pwm, 0)
    angles, _ = respond(
        time_s, pwm, 0.0, 0.0, time_s, wheel.gain, wheel.tau_s, 19.3, 19.3, wheel.static_ratio, delay_s
    )
    assert angles == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("delay_s", [0.0, 0.04, 0.13])
def test_taps_are_the_counted_response(delay_s: float) -> None:
    """y[k+1] = a y[k] + c0 u[k] + ... gives what counting the continuous answer gives."""
    model = MotorModel(
        gain=0.06, time_constant_s=0.08, friction_forward=0.0, friction_backward=0.0, delay_s=delay_s
    )
    period_s = 0.1
    rng = np.random.default_rng(0)
    u = rng.uniform(50.0, 200.0, 40)
    time_s = np.arange(41, dtype=float) * period_s
    angles, _ = respond(time_s[:-1], u, 0.0, 0.0, time_s, 0.06, 0.08, 0.0, 0.0, 1.0, delay_s)
    counted = np.diff(angles) / period_s
    a, taps = model.taps(period_s)
    y = np.zeros(41)
    for k in range(40):
        y[k + 1] = a * y[k] + sum(tap * u[k - i] for i, tap in enumerate(taps) if k >= i)
    assert y[1:] == pytest.approx(counted, abs=1e-9)


def test_two_taps_are_those_of_the_derivation() -> None:
    """c0 = K (1 - b), c1 = K (b - a), a = exp(-T/tau), b = (1 - a) tau / T."""
    model = MotorModel(gain=2.0, time_constant_s=0.075, friction_forward=0.0, friction_backward=0.0)
    a, taps = model.taps(0.1)
    b = (1.0 - a) * 0.75
    assert a == pytest.approx(np.exp(-0.1 / 0.075))
    assert taps == pytest.approx([2.0 * (1.0 - b), 2.0 * (b - a)])


def test_python_control_gets_the_same_plant() -> None:
    import control

    model = MotorModel(
        gain=0.0584, time_constant_s=0.075, friction_forward=19.0, friction_backward=19.0, delay_s=0.02
    )
    _, counted = control.step_response(model.discrete(0.1), 3.0)
    angles, _ = respond(
        np.zeros(1),
        np.ones(1),
        0.0,
        0.0,
        np.arange(31, dtype=float) * 0.1,
        0.0584,
        0.075,
        0.0,
        0.0,
        1.0,
        0.02,
    )
    assert counted[1:31] == pytest.approx(np.diff(angles) / 0.1, abs=1e-9)
    assert control.dcgain(model.continuous()) == pytest.approx(0.0584)


def test_richer_motors_without_their_extras_are_the_plain_one() -> None:
    time_s = np.arange(0.0, 4.0, 0.1)
    pwm = np.where(time_s < 1.0, 150.0, np.where(time_s < 2.0, 0.0, -90.0))
    plain, _ = respond(time_s, pwm, 0.0, 0.0, time_s, 0.0584, 0.1, 19.0, 19.0, 1.0, 0.02)
    richer, _ = respond_two(time_s, pwm, 0.0, 0.0, time_s, 0.0584, 0.1, 19.0, 19.0, 0.02, 0.0, 0.0, 1.0)
    assert richer == pytest.approx(plain, abs=0.02)
