"""The complete wheel controller against the same control law in float64, over the full input range."""

import ctypes
import math
import random
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.board.messages import PARAMETERS

LIMITS = [(round(spec.minimum * spec.scale), round(spec.maximum * spec.scale)) for spec in PARAMETERS]
parameter_sets = st.tuples(*(st.one_of(st.integers(*limit), st.sampled_from(limit)) for limit in LIMITS))
counts_ = st.one_of(st.integers(-330, 330), st.integers(-32_768, 32_767))
targets = st.one_of(st.integers(-17_000, 17_000), st.sampled_from([-17_000, 0, 17_000]))


def clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def ramped(last: float, target: float, speed_up: float, slow_down: float) -> float:
    """Return the set-point after `last`."""
    change = target - last
    if speed_up == 0 or abs(change) <= speed_up:
        return target
    if last * change >= 0 or abs(last) <= speed_up:
        return last + math.copysign(speed_up, change)
    return last + clamp((target if target * last > 0 else 0) - last, slow_down)


class FloatWheel:
    """The law of docs/explanation/control-law.md in float64, with the constants derived by the firmware."""

    def __init__(self) -> None:
        self.setpoint = self.model = self.predicted = self.integral = 0.0
        self.at_rest = False  # where whole mrad/s decide whether the integral is cleared

    def set_state(self, state: ctypes.Array[ctypes.c_int32]) -> None:
        """Set the state from the core's integers."""
        self.integral, self.model, self.predicted = state[0] / 2**19, float(state[1]), float(state[2])
        self.setpoint = float(state[3])

    def step(self, constants: list[float], target: float, counts: float, rate_Hz: int = 10) -> float:
        kp, ki, friction, kv, lead, decay, mean, *ramp = constants
        speed = round(clamp(counts * 2 * math.pi * rate_Hz / 1200 * 1000, 32_767))
        last = self.setpoint
        self.setpoint = ramped(last, target, *ramp)
        wanted = self.predicted if kv != 0 else self.setpoint
        steady = self.setpoint + lead * (self.setpoint - last)
        away = clamp(self.model - steady, 32_767)
        self.predicted, self.model = steady + mean * away, steady + decay * away
        feed_forward = kv * steady + friction * ((self.setpoint > 0) - (self.setpoint < 0))
        error = clamp(wanted - speed, 32_767)
        self.at_rest = self.setpoint == 0 and abs(error) <= 2
        if self.setpoint == 0 and (last != 0 or error == 0):
            self.integral = 0.0
        before = kp * error + feed_forward + self.integral
        if not ((before >= 255 and error > 0) or (before <= -255 and error <= 0)):
            self.integral = clamp(self.integral + ki * error, 255)
        return clamp(kp * error + feed_forward + self.integral, 255)


def constants_of(core: ctypes.CDLL, values: ctypes.Array[ctypes.c_int32], battery_mV: int) -> list[float]:
    raw = (ctypes.c_int32 * 9)()
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
        *raw[7:],
    ]


@settings(max_examples=100, deadline=None)
@given(
    rate_Hz=st.sampled_from([10, 50, 100]),
    parameters=parameter_sets,
    ticks=st.lists(
        st.tuples(targets, st.integers(1, 8), counts_, st.integers(0, 9000)), min_size=1, max_size=15
    ),
)
def test_every_tick_of_any_drive_is_within_one_pwm(
    core_at_rate: Callable[[int], ctypes.CDLL],
    rate_Hz: int,
    parameters: tuple[int, ...],
    ticks: list[tuple[int, int, int, int]],
) -> None:
    """Any parameters, and sequences of any set-point, count and battery, including reversals. The reference
    takes the core's state before each tick, so only the effect of that tick is compared."""
    core = core_at_rate(rate_Hz)
    values = (ctypes.c_int32 * len(parameters))(*parameters)
    chip, reference = core.wheel_new(), FloatWheel()
    state, out = (ctypes.c_int32 * 4)(), (ctypes.c_int * 4)()
    for target, stretch, counts, battery_mV in ticks:
        constants = constants_of(core, values, battery_mV)
        turned = core.speed_from_counts(counts, 1200) / (2 * math.pi * rate_Hz / 1200 * 1000)  # whole mrad/s
        for _ in range(stretch):
            core.wheel_state(chip, state)
            reference.set_state(state)
            assert core.wheel_step(chip, values, target, counts, battery_mV, out) == 0
            exact = reference.step(constants, target, turned, rate_Hz)
            core.wheel_state(chip, state)
            assert abs(out[2] - exact) <= 1.0
            assert state[3] == reference.setpoint
            assert abs(state[1] - reference.model) <= 2.0, "rounded towards the model's input"
            assert abs(state[2] - reference.predicted) <= 1.5


def test_two_ticks_in_numbers_are_those_of_the_page(core: ctypes.CDLL) -> None:
    """docs/explanation/control-law.md: from rest to 4 rad/s, with 11 counts in the first interval."""
    parameters = [round(spec.default * spec.scale) for spec in PARAMETERS]
    values = (ctypes.c_int32 * len(parameters))(*parameters)
    wheel, state, out = core.wheel_new(), (ctypes.c_int32 * 4)(), (ctypes.c_int * 4)()
    seen = []
    for counts in (0, 11):
        core.wheel_step(wheel, values, 4000, counts, 7400, out)
        core.wheel_state(wheel, state)
        seen.append((out[0], state[3], out[2], state[0] / 2**19, state[2]))
    (y_1, r_1, u_1, integral_1, p_2), (y_2, r_2, u_2, integral_2, _) = seen
    assert (y_1, r_1, u_1, integral_1) == (0, 800, 43, 0.0)
    assert (y_2, r_2, u_2) == (576, 1600, 58)
    assert p_2 == 629, "exactly 626.8; the core approximates exp"
    assert integral_2 == pytest.approx(10.9 * 0.053, abs=0.01)


@pytest.mark.slow
def test_ramp_and_model_do_not_drift_in_a_long_drive(core: ctypes.CDLL) -> None:
    """Seven hours with starts, reversals and stops. The reference takes the integral, which test_pi proves
    exact, after each tick. Its ramp, model and feed-forward run independently."""
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
        speed += 0.7 * (out[2] * 1.115 - speed)  # roughly a wheel: counts per tick
        core.wheel_step(chip, values, target, int(speed), 7400, out)
        difference = abs(out[2] - reference.step(constants, target, int(speed)))
        worst = worst if reference.at_rest else max(worst, difference)
        reference.integral = out[3] / 64
    assert worst <= 1.0


def counted(speed_mrad_s: float) -> int:
    """Return the counts of a tick at 10 Hz."""
    return round(speed_mrad_s * 1200 / (2 * math.pi * 1000 * 10))


def test_core_and_reference_drive_equal_wheels_alike(core: ctypes.CDLL) -> None:
    """No shared state: two controllers with two equal wheels. A count that falls into the next tick separates
    them by a few PWM for a moment. In 99 of 100 ticks they agree within 2, and they never drift apart."""
    noise = random.Random(2)
    parameters = [round(spec.default * spec.scale) for spec in PARAMETERS]
    values = (ctypes.c_int32 * len(parameters))(*parameters)
    constants = constants_of(core, values, 7400)
    chip, reference = core.wheel_new(), FloatWheel()
    out = (ctypes.c_int * 4)()
    target = 0
    speeds, pwms = [0.0, 0.0], [0.0, 0.0]
    apart = []
    for tick in range(10_000):
        if tick % 40 == 0:
            target = noise.choice([-8000, -3000, 0, 2500, 8000])
        speeds = [
            steady + 0.45 * (speed - steady)
            for speed, steady in zip(speeds, [1000 / 17.12 * pwm for pwm in pwms], strict=True)
        ]
        core.wheel_step(chip, values, target, counted(speeds[0]), 7400, out)
        pwms = [out[2], reference.step(constants, target, counted(speeds[1]))]
        apart.append(abs(pwms[0] - pwms[1]))
    assert sorted(apart)[len(apart) * 99 // 100] <= 2.0
    early, late = sum(apart[:2000]), sum(apart[-2000:])
    assert late <= 2 * early


def test_model_constants_are_consistent_and_limited_to_thirty_ticks(core: ctypes.CDLL) -> None:
    """b follows from a and tau/T bit for bit. A slower wheel counts as one of 30 ticks."""
    out = (ctypes.c_int32 * 9)()
    for kv, ka, lead in ((8976, 2693, 768), (300, 8000, 30 * 256)):
        core.derive((ctypes.c_int32 * 8)(0, 0, 0, kv, ka, 1, 0, 18000), 7400, out)
        assert out[4] == pytest.approx(lead, abs=1)
        assert out[6] == (2**15 - out[5]) * out[4] >> 8
    assert out[4] == 30 * 256
