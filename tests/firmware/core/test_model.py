"""The wheel model bit for bit: its limits, its rounding, and the friction feed-forward."""

import ctypes
import math
from dataclasses import dataclass

import pytest

from thumper.board.messages import PARAMETERS

INDEX = {spec.name: spec.index for spec in PARAMETERS}
LEAST_TICKS_Q8, MOST_TICKS_Q8 = 256 // 6, 30 * 256
"""Smallest and largest tau/T of a wheel model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Constants derived by the firmware: limited tau/T (Q8), a and b (Q15)."""

    lead: int
    decay: int
    mean: int


def wire(**values: int) -> ctypes.Array[ctypes.c_int32]:
    """Return parameters that are all 0 except these."""
    array = (ctypes.c_int32 * len(PARAMETERS))()
    array[INDEX["current_limit"]] = 1000
    for name, value in values.items():
        array[INDEX[name]] = value
    return array


def model(core: ctypes.CDLL, kv: int, ka: int, acceleration: int = 1) -> Model:
    out = (ctypes.c_int32 * 9)()
    core.derive(wire(kv=kv, ka=ka, acceleration=acceleration), 7400, out)
    return Model(lead=out[4], decay=out[5], mean=out[6])


def ticks_q8(kv: int, ka: int) -> int:
    """Return tau/T at 10 Hz."""
    return ka * 10 * 256 // kv


@pytest.mark.parametrize(("kv", "ka"), [(0, 1000), (1000, 0), (0, 0), (61, 1), (2560, LEAST_TICKS_Q8 - 1)])
def test_no_model_below_a_sixth_of_a_tick(core: ctypes.CDLL, kv: int, ka: int) -> None:
    old = model(core, 1000, 1000)  # stays in memory
    assert 0 not in (old.lead, old.decay, old.mean)
    assert model(core, kv, ka) == Model(lead=0, decay=0, mean=0)


@pytest.mark.parametrize(("kv", "ka"), [(1, 1), (10, 1), (2560, LEAST_TICKS_Q8), (60, 1)])
def test_a_model_from_a_sixth_of_a_tick_on(core: ctypes.CDLL, kv: int, ka: int) -> None:
    got = model(core, kv, ka)
    assert got.lead == min(ticks_q8(kv, ka), MOST_TICKS_Q8)
    assert got.decay > 0
    assert got.mean > 0


@pytest.mark.parametrize("ka", [900, 901, 902, 929, 930, 2000])
def test_the_time_constant_is_limited_to_thirty_ticks(core: ctypes.CDLL, ka: int) -> None:
    assert ticks_q8(300, ka) >= MOST_TICKS_Q8
    assert model(core, 300, ka).lead == MOST_TICKS_Q8


@pytest.mark.parametrize("acceleration", [250, 256, 500, 700, 1000, 3500, 20_000])
def test_the_feed_forward_leads_by_seven_rad_s_at_most(core: ctypes.CDLL, acceleration: int) -> None:
    """The limit is also used in full: it equals lead times the largest step of the ramp."""
    assert model(core, 300, 2000, acceleration).lead == 7000 * 256 // acceleration


def test_without_a_ramp_there_is_no_lead(core: ctypes.CDLL) -> None:
    assert model(core, 300, 200, 0).lead == 0


def test_the_decay_matches_its_formula_for_every_wheel(core: ctypes.CDLL) -> None:
    """(1 - z + z^2/2)^8 with z = T/(8 tau), each step rounded down in Q15. The rounding of z makes it larger
    by at most 8 units; the square and the three powers make it smaller by at most 15."""
    for ticks in range(LEAST_TICKS_Q8, MOST_TICKS_Q8 + 1):
        z = 256 / ticks / 8
        got = model(core, 2560, ticks)
        assert -15 <= got.decay - 2**15 * (1 - z + z * z / 2) ** 8 <= 8
        assert got.mean == (2**15 - got.decay) * ticks >> 8


def test_the_model_matches_its_equations_bit_for_bit(core: ctypes.CDLL) -> None:
    """v' = w + a (v - w), rounded towards w; y' = w + b (v - w), rounded. From rest, with set-points of both
    signs."""
    even = [ka for ka in range(42, 3000) if model(core, 2560, ka, 0).decay % 256 == 0]
    assert even, "rounding can fail at set-points with an integer decay"
    state, out = (ctypes.c_int32 * 4)(), (ctypes.c_int * 4)()
    for ka in even[:5]:
        constants = model(core, 2560, ka, 0)
        for target in range(-16_896, 17_000, 128):
            wheel = core.wheel_new()
            assert core.wheel_step(wheel, wire(kv=2560, ka=ka), target, 0, 7400, out) == 0
            core.wheel_state(wheel, state)
            assert state[1] == target + math.trunc(-target * constants.decay / 2**15)
            assert state[2] == target + math.floor(-target * constants.mean / 2**15 + 0.5)


@pytest.mark.parametrize(("target", "pwm"), [(0, 0), (1, 20), (-1, -20), (17_000, 20), (-17_000, -20)])
def test_friction_feed_forward_applies_from_the_smallest_set_point(
    core: ctypes.CDLL, target: int, pwm: int
) -> None:
    out = (ctypes.c_int * 4)()
    assert core.wheel_step(core.wheel_new(), wire(ks=20 * 128), target, 0, 7400, out) == 0
    assert out[2] == pwm


def test_track_speed_clears_all_but_the_speed(core: ctypes.CDLL) -> None:
    wheel, state, out = core.wheel_new(), (ctypes.c_int32 * 4)(), (ctypes.c_int * 4)()
    core.wheel_state(wheel, state)
    assert list(state) == [0, 0, 0, 0]
    for _ in range(3):
        core.wheel_step(wheel, wire(kp=5000, ki=5000, kv=2560, ka=300), 5000, 7, 7400, out)
    core.wheel_state(wheel, state)
    assert 0 not in list(state)
    core.wheel_track_speed(wheel, -1234)
    core.wheel_state(wheel, state)
    assert list(state) == [0, -1234, -1234, 0]


def test_the_integral_clears_when_the_wheel_has_stopped(core: ctypes.CDLL) -> None:
    wheel, state, out = core.wheel_new(), (ctypes.c_int32 * 4)(), (ctypes.c_int * 4)()
    for target, integral in ((1000, 5000 * 1000), (0, 0)):
        core.wheel_step(wheel, wire(ki=5000), target, 0, 7400, out)
        core.wheel_state(wheel, state)
        assert state[0] == integral


@pytest.mark.parametrize("sign", [1, -1])
def test_the_integral_is_dropped_when_the_ramp_arrives_at_zero(core: ctypes.CDLL, sign: int) -> None:
    """What overcame friction would keep a stopped wheel creeping. From then on the integral works as ever."""
    wheel, state, out = core.wheel_new(), (ctypes.c_int32 * 4)(), (ctypes.c_int * 4)()
    integral = 0
    for target, arrives in ((1000, False), (500, False), (0, True), (0, False), (0, False)):
        core.wheel_step(wheel, wire(ki=5000), sign * target, sign * 3, 7400, out)
        error = sign * target - out[0]
        integral = (0 if arrives else integral) + 5000 * error
        core.wheel_state(wheel, state)
        assert state[0] == integral


def test_the_gains_follow_the_battery_rounded_to_nearest(core: ctypes.CDLL) -> None:
    out = (ctypes.c_int32 * 9)()
    for battery_mV in range(5000, 14_000, 37):
        ratio = core.supply_ratio(battery_mV, 7400) / 4096
        for kv in (1, 2, 3, 8976, 20_001):
            core.derive(wire(ks=2470, kv=kv), battery_mV, out)
            assert out[2] == 2470 * ratio * 4096
            assert abs(out[3] - kv * ratio) <= 0.5
