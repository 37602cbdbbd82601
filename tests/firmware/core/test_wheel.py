"""Ramp, feed-forward, prediction and PI together, on a simulated first-order wheel."""

import ctypes
import math
from collections.abc import Callable

import pytest

RATE_HZ = 10
GAIN = 0.0584  # [rad/s per PWM] at 7.4 V
KS_PWM = 19.3
TAU_S = 0.075
SCALES = {
    "kp": 524.288,
    "ki": 524.288,
    "ks": 128.0,
    "kv": 524.288,
    "ka": 524.288,
    "acceleration": 100.0,
    "deceleration": 100.0,
    "current_limit": 1000.0,
}
DEFAULTS = {
    "kp": 6.1,
    "ki": 10.9,
    "ks": 19.3,
    "kv": 17.12,
    "ka": 1.284,
    "acceleration": 8.0,
    "deceleration": 16.0,
    "current_limit": 8.0,
}
THESIS = {"kp": 15.0, "ki": 0.5, "ks": 0.0, "kv": 0.0, "ka": 0.0, "acceleration": 0.0}
THESIS |= {"deceleration": 0.0, "current_limit": 8.0}


class Wheel:
    """First-order wheel with static friction, counted per tick like the encoder, driven by the core."""

    def __init__(self, core: ctypes.CDLL, parameters: dict[str, float], supply: float = 1.0) -> None:
        self.core, self.controller, self.supply = core, core.wheel_new(), supply
        values = [round(value * SCALES[name]) for name, value in parameters.items()]
        self.values = (ctypes.c_int32 * len(values))(*values)
        self.speed = self.angle = 0.0
        self.count = self.pwm = 0

    def step(self, target_rad_s: float) -> tuple[float, float, int]:
        """Advance one tick; return measured speed, set-point [rad/s] and the PWM for the next tick."""
        drive = self.supply * self.pwm - math.copysign(KS_PWM, self.pwm)
        steady = GAIN * drive if abs(self.supply * self.pwm) > KS_PWM else 0.0
        period = 1 / RATE_HZ
        decay = math.exp(-period / TAU_S)
        self.angle += steady * period + (self.speed - steady) * TAU_S * (1 - decay)
        self.speed = steady + (self.speed - steady) * decay
        count = math.floor(self.angle * 1200 / math.tau)
        out = (ctypes.c_int * 4)()
        battery_mV = round(7400 * self.supply)
        target = round(target_rad_s * 1000)
        assert (
            self.core.wheel_step(self.controller, self.values, target, count - self.count, battery_mV, out)
            == 0
        )
        self.count, self.pwm = count, out[2]
        return out[0] / 1000, out[1] / 1000, out[2]


@pytest.mark.parametrize("supply", [6.6 / 7.4, 1.0, 8.4 / 7.4])
@pytest.mark.parametrize("acceleration", [4.0, 8.0])
def test_tracks_a_trapezoid_at_any_battery_voltage(
    core: ctypes.CDLL, acceleration: float, supply: float
) -> None:
    """Set-point minus measured speed of the same interval, 0 -> 8 -> 0 rad/s: std <= 0.08 rad/s, no bias."""
    wheel = Wheel(core, DEFAULTS | {"acceleration": acceleration, "deceleration": 0.0}, supply)
    errors = []
    for tick in range(120):
        speed, setpoint, _ = wheel.step(8.0 if 5 <= tick < 90 else 0.0)
        errors.append(setpoint - speed)
    mean = sum(errors) / len(errors)
    std = math.sqrt(sum((e - mean) ** 2 for e in errors) / len(errors))
    assert std <= 0.08
    assert abs(mean) <= 0.03


def test_a_start_does_not_overshoot(core: ctypes.CDLL) -> None:
    """A PI that treats the unavoidable lag as an error would add to the feed-forward and overshoot."""
    wheel = Wheel(core, DEFAULTS)
    speeds = [wheel.step(8.0)[0] for _ in range(40)]
    assert max(speeds) <= 8.0 * 1.03
    assert speeds[-20:] == pytest.approx([8.0] * 20, abs=0.11)


def test_the_prediction_keeps_the_integral_small(core: ctypes.CDLL) -> None:
    """With a perfect model the PI corrects only quantization."""
    wheel = Wheel(core, DEFAULTS)
    pwm = [wheel.step(8.0)[2] for _ in range(40)]
    steady = 19.3 + 8.0 / GAIN
    assert max(pwm) <= steady + 17.12 * 0.8 * 0.75 + 3


def test_without_feed_forward_the_controller_is_a_plain_pi(core: ctypes.CDLL) -> None:
    """All feed-forward gains 0: u = Kp e + I on the newest set-point, exact to one PWM count."""
    wheel = Wheel(core, THESIS)
    kp, ki = round(15.0 * 524.288) / 2**19, round(0.5 * 524.288) / 2**19
    integral = 0.0
    for tick in range(80):
        target = 8.0 if tick < 40 else -3.0
        speed, _, pwm = wheel.step(target)
        error = round(target * 1000) - round(speed * 1000)
        before = kp * error + integral
        if not ((before >= 255 and error > 0) or (before <= -255 and error < 0)):
            integral += ki * error
        assert abs(pwm - max(-255.0, min(255.0, kp * error + integral))) <= 0.5


@pytest.mark.parametrize("supply", [6.6 / 7.4, 1.0, 8.4 / 7.4])
def test_brakes_twice_as_fast_as_it_speeds_up(core: ctypes.CDLL, supply: float) -> None:
    """From 8 rad/s at 16 rad/s^2: 2 rad of braking and what the command waits, not 4 as at 8 rad/s^2."""
    wheel = Wheel(core, DEFAULTS, supply)
    for _ in range(40):
        wheel.step(8.0)
    stopping = [wheel.step(0.0)[0] for _ in range(10)]
    assert 2.0 < 0.1 * sum(stopping) < 2.6
    assert min(stopping) >= -0.2, "it does not swing back"


def test_stops_and_stays_stopped(core: ctypes.CDLL) -> None:
    wheel = Wheel(core, DEFAULTS)
    for _ in range(30):
        wheel.step(5.0)
    outputs = [wheel.step(0.0)[2] for _ in range(40)]
    assert outputs[-20:] == [0] * 20


@pytest.mark.parametrize("rate_Hz", [10, 100])
@pytest.mark.parametrize("tau_s", [0.02, 0.04, 0.075, 0.15, 0.3])
def test_prediction_constants_match_the_exponential(
    core_at_rate: Callable[[int], ctypes.CDLL], rate_Hz: int, tau_s: float
) -> None:
    """a = exp(-T/tau), b = (1-a) tau/T (feedforward.hpp)."""
    out = (ctypes.c_int32 * 9)()
    values = (ctypes.c_int32 * 8)(
        0, 0, 0, round(17.12 * 524.288), round(17.12 * tau_s * 524.288), 800, 0, 18000
    )
    core_at_rate(rate_Hz).derive(values, 7400, out)
    x = 1 / (rate_Hz * tau_s)
    a = math.exp(-x)
    b = (1 - a) / x
    assert out[4] / 2**8 == pytest.approx(1 / x, rel=0.02)
    assert out[5] / 2**15 == pytest.approx(a, abs=0.01)
    assert out[6] / 2**15 == pytest.approx(b, abs=0.02)
