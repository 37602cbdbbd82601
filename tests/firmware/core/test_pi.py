"""The fixed-point PI against the same control law in float64."""

import ctypes
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

Q19 = 2.0**19
MAX_GAIN = {"kp": 31457, "ki": 15729}
gains = st.tuples(st.integers(0, MAX_GAIN["kp"]), st.integers(0, MAX_GAIN["ki"]))
errors = st.one_of(st.integers(-2000, 2000), st.integers(-32_767, 32_767), st.just(0))
feed_forwards = st.one_of(
    st.integers(-1700 * 2**19, 1700 * 2**19), st.sampled_from([0, -1700 * 2**19, 1700 * 2**19])
)


class FloatPi:
    """u = Kp e + I; I += Ki e unless saturated in that direction; I is clamped, and cleared at rest."""

    def __init__(self) -> None:
        self.integral_pwm = 0.0

    def step(self, kp: float, ki: float, error: float, feed_forward_pwm: float, idle: bool) -> float:
        if idle and error == 0:
            self.integral_pwm = 0.0
        before = kp * error + feed_forward_pwm + self.integral_pwm
        if not ((before >= 255 and error > 0) or (before <= -255 and error < 0)):
            self.integral_pwm = min(max(self.integral_pwm + ki * error, -255.0), 255.0)
        return min(max(kp * error + feed_forward_pwm + self.integral_pwm, -255.0), 255.0)


@settings(max_examples=300, deadline=None)
@given(gain=gains, inputs=st.lists(st.tuples(errors, feed_forwards, st.booleans()), max_size=60))
def test_within_one_pwm_of_float_for_every_input(
    core: ctypes.CDLL, gain: tuple[int, int], inputs: list[tuple[int, int, bool]]
) -> None:
    kp, ki = gain
    chip, reference = core.pi_new(), FloatPi()
    for error, feed_forward, idle in inputs:
        pwm = core.pi_step(chip, kp, ki, error, feed_forward, int(idle))
        exact = reference.step(kp / Q19, ki / Q19, error, feed_forward / Q19, idle)
        assert abs(pwm - exact) <= 0.5
        assert core.pi_integral(chip) == reference.integral_pwm * Q19, "the integral must be exact"


@pytest.mark.slow
def test_no_drift_in_a_million_ticks(core: ctypes.CDLL) -> None:
    noise = random.Random(1)
    ticks, kp, ki = 1_000_000, 6082, 4194
    errors = (ctypes.c_int16 * ticks)(*(wide - 500 for wide in noise.choices(range(1001), k=ticks)))
    pwms = (ctypes.c_int16 * ticks)()
    integral = core.pi_run(kp, ki, errors, ticks, pwms) / Q19
    exact = 0.0
    worst = 0.0
    for error, pwm in zip(errors, pwms, strict=True):  # FloatPi.step inlined: a call takes longer
        before = kp / Q19 * error + exact
        if not ((before >= 255 and error > 0) or (before <= -255 and error < 0)):
            exact = min(max(exact + ki / Q19 * error, -255.0), 255.0)
        wanted = min(max(kp / Q19 * error + exact, -255.0), 255.0)
        worst = max(worst, abs(pwm - wanted))
    assert worst <= 0.5
    assert integral == exact


def test_the_largest_inputs_saturate_in_the_right_direction(core: ctypes.CDLL) -> None:
    """The sum comes within 6 % of int32's limit. The library aborts on any overflow."""
    chip = core.pi_new()
    for sign in (1, -1, 1, -1):
        for feed_forward in (0, sign * 1700 * 2**19):
            pwm = core.pi_step(chip, MAX_GAIN["kp"], MAX_GAIN["ki"], sign * 32_767, feed_forward, 0)
            assert pwm == sign * 255


@pytest.mark.parametrize("sign", [1, -1])
def test_the_integral_is_exact_close_to_its_limit(core: ctypes.CDLL, sign: int) -> None:
    """The limit compares the upper half of the integral only."""
    chip, limit = core.pi_new(), sign * 255 * 2**19
    against = -sign * 2**20  # a feed-forward that keeps the output from saturating, which would freeze it
    for ki, error, expected in ((15_729, 17_000, limit), (100, -1, limit - sign * 100), (100, 3, limit)):
        core.pi_step(chip, 0, ki, sign * error, against, 0)
        assert core.pi_integral(chip) == expected


def test_only_the_integral_freezes_while_saturated(core: ctypes.CDLL) -> None:
    """The thesis's code froze the whole output, so P was stale until the error changed sign."""
    chip = core.pi_new()
    kp, ki = 15729, 262  # 30 and 0.5 PWM/(rad/s)
    assert core.pi_step(chip, kp, ki, 17_000, 0, 0) == 255
    frozen = core.pi_integral(chip)
    assert core.pi_step(chip, kp, ki, 17_000, 0, 0) == 255
    assert core.pi_integral(chip) == frozen
    assert core.pi_step(chip, kp, ki, 1_000, 0, 0) == round((frozen + (kp + ki) * 1000) / Q19)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("error", [1, 2, 1000])
def test_the_integral_freezes_exactly_at_saturation(core: ctypes.CDLL, sign: int, error: int) -> None:
    """Feed-forward alone saturates the output. Outwards the integral stays; inwards it changes. Just below
    the limit it changes in both directions."""
    full = 255 * 2**19
    for feed_forward, way, grows in ((full, 1, False), (full, -1, True), (full - 1, 1, True)):
        chip = core.pi_new()
        core.pi_step(chip, 0, 4194, sign * way * error, sign * feed_forward, 0)
        assert core.pi_integral(chip) == (sign * way * error * 4194 if grows else 0)


def test_reset_clears_the_integral(core: ctypes.CDLL) -> None:
    chip = core.pi_new()
    core.pi_step(chip, 0, 4194, 1000, 0, 0)
    core.pi_reset(chip)
    assert core.pi_integral(chip) == 0


def test_integral_clears_only_at_rest(core: ctypes.CDLL) -> None:
    chip = core.pi_new()
    core.pi_step(chip, 0, 4194, 1000, 0, 0)
    assert core.pi_integral(chip) == 4194 * 1000
    core.pi_step(chip, 0, 4194, 0, 0, 0)  # moving with zero error: keeps it
    assert core.pi_integral(chip) == 4194 * 1000
    assert core.pi_step(chip, 0, 4194, 0, 0, 1) == 0
    assert core.pi_integral(chip) == 0
