"""The whole wheel controller against the same law in float64, over the whole range of everything."""

import ctypes
import math
import random

from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.link.messages import PARAMETERS

LIMITS = [(round(spec.minimum * spec.scale), round(spec.maximum * spec.scale)) for spec in PARAMETERS]
parameter_sets = st.tuples(*(st.one_of(st.integers(*limit), st.sampled_from(limit)) for limit in LIMITS))
counts_ = st.one_of(st.integers(-330, 330), st.integers(-32_768, 32_767))
targets = st.one_of(st.integers(-17_000, 17_000), st.sampled_from([-17_000, 0, 17_000]))


def clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


class FloatWheel:
    """The law of docs/firmware.md in float64, with the constants that the firmware derived."""

    def __init__(self) -> None:
        self.setpoint = self.model = self.predicted = self.integral = 0.0
        self.at_rest = False  # where whole mrad/s decide whether the integral is cleared

    def step(self, constants: list[float], target: float, counts: int, rate_Hz: int = 10) -> float:
        kp, ki, friction, kv, lead, decay, mean, ramp = constants
        speed = round(clamp(counts * 2 * math.pi * rate_Hz / 1200 * 1000, 32_767))
        last = self.setpoint
        self.setpoint = target if ramp == 0 else last + clamp(target - last, ramp)
        wanted = self.predicted if kv != 0 else self.setpoint
        steady = self.setpoint + lead * (self.setpoint - last)
        away = clamp(self.model - steady, 32_767)
        self.predicted, self.model = steady + mean * away, steady + decay * away
        feed_forward = kv * steady + friction * ((self.setpoint > 0) - (self.setpoint < 0))
        error = clamp(wanted - speed, 32_767)
        self.at_rest = self.setpoint == 0 and abs(error) <= 2
        if self.setpoint == 0 and error == 0:
            self.integral = 0.0
        before = kp * error + feed_forward + self.integral
        if not ((before >= 255 and error > 0) or (before <= -255 and error <= 0)):
            self.integral = clamp(self.integral + ki * error, 255)
        return clamp(kp * error + feed_forward + self.integral, 255)


def constants_of(core: ctypes.CDLL, values: ctypes.Array[ctypes.c_int32], battery_mV: int) -> list[float]:
    raw = (ctypes.c_int32 * 8)()
    core.derive(values, battery_mV, raw)
    q19 = 2.0**19
    return [
        raw[0] / q19,
        raw[1] / q19,
        raw[2] / q19,
        raw[3] / q19,
        raw[4] / 256,
        raw[5] / 2**15,
        raw[6] / 2**15,
        raw[7],
    ]


@settings(max_examples=200, deadline=None)
@given(
    parameters=parameter_sets,
    battery_mV=st.integers(0, 9000),
    inputs=st.lists(st.tuples(targets, counts_), min_size=1, max_size=1),
)
def test_one_step_from_rest_is_within_one_pwm(
    core: ctypes.CDLL, parameters: tuple[int, ...], battery_mV: int, inputs: list[tuple[int, int]]
) -> None:
    """Any parameters, any battery, any set-point and any count."""
    values = (ctypes.c_int32 * len(parameters))(*parameters)
    constants = constants_of(core, values, battery_mV)
    chip, reference = core.wheel_new(), FloatWheel()
    out = (ctypes.c_int * 4)()
    for target, counts in inputs:
        assert core.wheel_step(chip, values, target, counts, battery_mV, out) == 0
        exact = reference.step(constants, target, counts)
        assert abs(out[2] - exact) <= 1.0
        assert out[1] == 0


def test_ramp_and_model_do_not_drift_in_a_long_drive(core: ctypes.CDLL) -> None:
    """Seven hours with starts, reversals and stops. The integral, exact by test_pi, is taken over each
    tick; ramp, model and feed-forward run freely beside the chip's."""
    noise = random.Random(1)
    parameters = [round(spec.default * spec.scale) for spec in PARAMETERS]
    values = (ctypes.c_int32 * len(parameters))(*parameters)
    constants = constants_of(core, values, 7400)
    chip, reference = core.wheel_new(), FloatWheel()
    out = (ctypes.c_int * 4)()
    target = 0
    speed = worst = 0.0
    for tick in range(250_000):
        if tick % 40 == 0:
            target = noise.choice([-8000, -3000, 0, 0, 2500, 8000])
        speed += 0.7 * (out[2] * 1.115 - speed)  # a wheel, roughly: counts a tick
        core.wheel_step(chip, values, target, int(speed), 7400, out)
        difference = abs(out[2] - reference.step(constants, target, int(speed)))
        worst = worst if reference.at_rest else max(worst, difference)
        reference.integral = out[3] / 64
    assert worst <= 1.0
