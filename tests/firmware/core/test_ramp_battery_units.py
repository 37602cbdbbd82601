"""Set-point ramp, battery monitor, beeps and unit conversions."""

import ctypes
import itertools
import math
from collections.abc import Callable

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thumper.board.messages import AckStatus, Fault

setpoints = st.integers(-17_000, 17_000)
limits = st.integers(1, 20_000)


@settings(max_examples=200, deadline=None)
@given(start=setpoints, target=setpoints, acceleration=limits, deceleration=limits)
@example(start=900, target=100, acceleration=800, deceleration=400)
@example(start=-800, target=500, acceleration=800, deceleration=400)
@example(start=800, target=-500, acceleration=800, deceleration=400)
@example(start=-2000, target=-1000, acceleration=100, deceleration=5000)
def test_ramp_reaches_the_target_no_faster_than_allowed(
    core: ctypes.CDLL, start: int, target: int, acceleration: int, deceleration: int
) -> None:
    """At 10 Hz a limit in 0.01 rad/s^2 is the step in mrad/s."""
    after = core.ramp(start, target, acceleration, deceleration)
    if abs(target - start) <= acceleration:
        assert after == target
    elif (target - start) * start >= 0 or abs(start) <= acceleration:  # it speeds up, or reverses
        assert abs(after - start) == acceleration
    else:
        end = target if target * start > 0 else 0  # it brakes to this, and only then reverses
        assert abs(after - start) == min(deceleration, abs(end - start))
    assert abs(target - after) == abs(target - start) - abs(after - start), "straight to the target"


@given(start=setpoints, target=setpoints, acceleration=limits)
def test_without_a_deceleration_it_brakes_as_it_speeds_up(
    core: ctypes.CDLL, start: int, target: int, acceleration: int
) -> None:
    assert core.ramp(start, target, acceleration, 0) == core.ramp(start, target, acceleration, acceleration)


@given(start=setpoints, target=setpoints, deceleration=limits)
def test_without_an_acceleration_the_set_point_jumps(
    core: ctypes.CDLL, start: int, target: int, deceleration: int
) -> None:
    assert core.ramp_step(0) == 0
    assert core.ramp(start, target, 0, deceleration) == target


@pytest.mark.parametrize("rate_Hz", [10, 50, 100])
def test_ramp_step_is_the_acceleration_per_tick(
    core_at_rate: Callable[[int], ctypes.CDLL], rate_Hz: int
) -> None:
    """Rounded. Only 0 means no limit, so the slowest ramp is one step per tick."""
    core, steps = core_at_rate(rate_Hz), rate_Hz // 10
    for acceleration in range(20_001):
        rounded = (2 * acceleration + steps) // (2 * steps)
        assert core.ramp_step(acceleration) == (max(1, rounded) if acceleration else 0)


@pytest.mark.parametrize("counts_per_rev", [40, 333, 1200, 1920, 12_345, 30_000])
@pytest.mark.parametrize("rate_Hz", [10, 50, 100])
def test_speed_is_the_thesis_formula_rounded(
    core_at_rate: Callable[[int], ctypes.CDLL], rate_Hz: int, counts_per_rev: int
) -> None:
    """omega = n 2 pi / (N T) (eq. 2.1), clamped to int16 and never wrapped. The speed of one count is rounded
    down to 2^-16 mrad/s."""
    core = core_at_rate(rate_Hz)
    per_count = math.tau * rate_Hz / counts_per_rev * 1000
    for counts in range(-700, 701):
        exact = counts * per_count
        speed = core.speed_from_counts(counts, counts_per_rev)
        if abs(exact) < 32_767 - per_count:
            assert -abs(counts) / 65_536 - 0.501 <= abs(speed) - abs(exact) <= 0.501
        assert speed == 0 or math.copysign(1, speed) == math.copysign(1, counts)
    fastest = core.speed_from_counts(32_767, counts_per_rev)
    assert min(32_767 - 2 * per_count, 32_760 * per_count) < fastest <= 32_767
    assert core.speed_from_counts(-32_768, counts_per_rev) == -fastest


def test_a_difference_is_limited_and_never_wraps(core: ctypes.CDLL) -> None:
    edges = [-32_768, -32_767, -16_384, -1, 0, 1, 16_384, 32_767]
    for a, b in itertools.product(edges, repeat=2):
        assert core.difference(a, b) == max(-32_767, min(32_767, a - b))


def test_battery_and_current_scales(core: ctypes.CDLL) -> None:
    """1007 counts are 30 V; 100 mV/A around 511 (sums of 32 samples)."""
    assert core.battery_from_sum(1007 * 32) == pytest.approx(30_000, abs=2)
    assert core.battery_from_sum(248 * 32) == pytest.approx(7_388, abs=2)
    assert core.current_from_sum(511 * 32, 25_000, 511) == 0
    assert core.current_from_sum(521 * 32, 25_000, 511) == 488
    assert core.current_from_sum(101 * 32, 25_000, 511) == pytest.approx(-410 * 48.828, abs=1)


@settings(max_examples=300, deadline=None)
@given(sum_=st.integers(0, 1023 * 32), scale=st.integers(512, 30_720), zero=st.integers(0, 1023))
def test_any_current_sensor_is_scaled_as_in_float64(
    core: ctypes.CDLL, sum_: int, scale: int, zero: int
) -> None:
    exact = (sum_ / 32 - zero) * scale / 512
    assert abs(core.current_from_sum(sum_, scale, zero) - max(-32_767.0, min(32_767.0, exact))) <= 0.501


@settings(max_examples=300, deadline=None)
@given(battery_mV=st.integers(1, 40_000), cells=st.integers(1, 7))
def test_any_battery_is_compensated_as_in_float64(core: ctypes.CDLL, battery_mV: int, cells: int) -> None:
    nominal = 3700 * cells
    exact = nominal / min(max(battery_mV, math.ceil(2 * nominal / 3)), 2 * nominal)
    assert 0 <= exact - core.supply_ratio(battery_mV, nominal) / 4096 < 1 / 4096


def test_the_battery_scale_is_rounded_once_over_its_range(core: ctypes.CDLL) -> None:
    for sum_ in range(0, 1023 * 32, 97):
        assert -0.3 <= sum_ * 30_000 / 1007 / 32 - core.battery_from_sum(sum_) <= 1.3


def test_supply_ratio_follows_the_voltage_within_limits(core: ctypes.CDLL) -> None:
    """7.4 V over the voltage, Q12, rounded down; the voltage is limited to 2/3 ... 2 times 7.4 V."""
    assert core.supply_ratio(0, 7400) == 4096
    for battery_mV in range(4934, 14_801):
        assert core.supply_ratio(battery_mV, 7400) == 4096 * 7400 // battery_mV
    assert core.supply_ratio(1, 7400) == core.supply_ratio(4933, 7400) == core.supply_ratio(4934, 7400)
    assert core.supply_ratio(14_801, 7400) == 2048
    assert core.supply_ratio(65_535, 7400) == 2048


def test_a_start_up_dip_is_no_empty_battery(core: ctypes.CDLL) -> None:
    battery = core.battery_new()
    core.battery_update(battery, 7400)
    for _ in range(3):  # 0.3 s at 5.5 V
        assert core.battery_update(battery, 5500) == 0
    assert core.battery_status(battery) == AckStatus.OK


def test_a_battery_must_prove_its_charge_after_a_reset(core: ctypes.CDLL) -> None:
    """Between 6.4 and 7.0 V a fresh start must wait, without a fault."""
    battery = core.battery_new()
    assert core.battery_status(battery) == AckStatus.BATTERY_UNKNOWN
    for _ in range(50):
        assert core.battery_update(battery, 7000) == 0
        assert core.battery_status(battery) == AckStatus.BATTERY_LOW
    core.battery_update(battery, 7016)
    assert core.battery_status(battery) == AckStatus.OK
    assert core.battery_update(core.battery_new(), 6399) == Fault.LOW_BATTERY
    assert core.battery_update(core.battery_new(), 6400) == Fault.NONE


def test_the_operator_is_warned_below_seven_volts(core: ctypes.CDLL) -> None:
    for reading_mV, warning in ((7000, 0), (6999, 1), (16, 1)):
        battery = core.battery_new()
        assert core.battery_warning(battery) == 0, "no reading yet"
        core.battery_update(battery, reading_mV)
        assert core.battery_warning(battery) == warning


def test_low_battery_trips_once_after_a_second_and_releases_above_7_V(core: ctypes.CDLL) -> None:
    battery = core.battery_new()
    core.battery_update(battery, 7400)
    trips = [core.battery_update(battery, 6000) for _ in range(60)]
    assert sum(trips) == Fault.LOW_BATTERY
    assert trips.index(Fault.LOW_BATTERY) * 0.096 >= 1.0, "filtered over at least a second"
    for _ in range(200):
        core.battery_update(battery, 6990)
    assert core.battery_status(battery) == AckStatus.BATTERY_LOW, "inside the hysteresis"
    for _ in range(200):
        core.battery_update(battery, 7050)
    assert core.battery_status(battery) == AckStatus.OK


def test_a_voltage_that_no_pack_has_is_a_fault_while_it_lasts(core: ctypes.CDLL) -> None:
    """Filtered, so braking that feeds back for a moment is none."""
    battery = core.battery_new()
    assert core.battery_update(battery, 9000) == Fault.NONE
    assert core.battery_status(battery) == AckStatus.OK
    assert core.battery_update(battery, 9016) == Fault.HIGH_BATTERY
    assert core.battery_update(battery, 9016) == Fault.HIGH_BATTERY
    assert core.battery_status(battery) == AckStatus.BATTERY_HIGH
    while core.battery_update(battery, 8000) == Fault.HIGH_BATTERY:
        assert core.battery_status(battery) == AckStatus.BATTERY_HIGH
    assert core.battery_status(battery) == AckStatus.OK


def test_a_high_voltage_is_a_fault_after_two_thirds_of_the_filter(core: ctypes.CDLL) -> None:
    """From 7.4 V, a reading of 9.8 V crosses the limit of 9.0 V with the 18th reading: 1.7 s at 96 ms each.

    The filter takes 1/16 of the difference per reading: 2.4 V * (15/16)^n is 0.8 V at n = 17.02.
    """
    battery = core.battery_new()
    core.battery_update(battery, 7400)
    faults = [core.battery_update(battery, 9800) for _ in range(30)]
    assert faults == [Fault.NONE] * 17 + [Fault.HIGH_BATTERY] * 13


def test_beeps_sound_only_while_the_wheels_are_quiet(core: ctypes.CDLL) -> None:
    """Five beeps of 200 ms with pauses of 200 ms, and none while anything moves."""
    beep = core.beep_new()
    assert [core.beep_step(beep, 1, 1) for _ in range(10)] == [0] * 10
    core.beep_start(beep, core.low_battery_beeps())
    assert [core.beep_step(beep, 1, 0) for _ in range(10)] == [0] * 10
    tones = [core.beep_step(beep, 1, 1) for _ in range(2500)]
    assert sum(tones) == 1000
    assert sum(later > earlier for earlier, later in zip([0, *tones], tones, strict=False)) == 5
    assert tones[:199] == [1] * 199
    core.beep_start(beep, 1)
    assert core.beep_step(beep, 255, 1) + core.beep_step(beep, 255, 1) == 0, "long steps do not wrap"
