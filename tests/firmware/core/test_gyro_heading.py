"""Heading from yaw rates against float64, and when the gyroscope's bias is calibrated."""

import ctypes
import math
import random

import pytest

LSB_PER_DEG_S = 32.8
WINDOW = 1024


def heading_deg(core: ctypes.CDLL, gyro: int) -> float:
    """Return the heading in [0, 360)."""
    return float(core.gyro_heading(gyro)) * 360.0 / 65536.0


def calibrate(core: ctypes.CDLL, bias: float, seed: int = 1, noise: float = 1.6) -> int:
    """Return a gyroscope that has measured its bias [LSB] under noise."""
    gyro: int = core.gyro_new()
    numbers = random.Random(seed)
    for number in range(WINDOW + 1):  # the first reading may only begin the window
        assert number >= WINDOW or not core.gyro_calibrated(gyro)
        assert core.gyro_measure(gyro, round(numbers.gauss(bias, noise)), 1)
    assert core.gyro_calibrated(gyro)
    return gyro


@pytest.mark.parametrize("rate_deg_s", [-970.0, -180.0, -7.3, 0.5, 33.3, 500.0])
@pytest.mark.parametrize("bias", [-650, 0, 123])
def test_the_heading_is_the_integral_of_the_rate(core: ctypes.CDLL, rate_deg_s: float, bias: int) -> None:
    """Ten seconds, in steps of one to four milliseconds: within 0.01 % and 0.01 deg of float64."""
    gyro = calibrate(core, bias, noise=0.3)
    before_deg, exact_deg, total_ms, wraps_deg, last_deg = heading_deg(core, gyro), 0.0, 0, 0.0, 0.0
    while total_ms < 10_000:
        raw = round(rate_deg_s * LSB_PER_DEG_S + bias) + total_ms % 2
        elapsed_ms = 1 + total_ms % 4
        core.gyro_measure(gyro, raw, 0)
        core.gyro_advance(gyro, elapsed_ms)
        exact_deg += (raw - bias) / LSB_PER_DEG_S * 1e-3 * elapsed_ms
        total_ms += elapsed_ms
        now_deg = heading_deg(core, gyro) - before_deg
        wraps_deg += math.remainder(now_deg - last_deg, 360.0)
        last_deg = now_deg
    # The bias' own error of 1/100 LSB is 0.003 deg after ten seconds.
    assert wraps_deg == pytest.approx(exact_deg, rel=1e-4, abs=0.02)


@pytest.mark.parametrize("bias", [-600.0, -0.4, 17.25, 640.0])
def test_the_bias_is_the_mean_of_a_second(core: ctypes.CDLL, bias: float) -> None:
    """A minute at rest turns the heading by less than the noise of the mean allows, 4 sigma."""
    gyro = calibrate(core, bias)
    numbers = random.Random(2)
    for _ in range(60_000):
        core.gyro_measure(gyro, round(numbers.gauss(bias, 1.6)), 0)
        core.gyro_advance(gyro, 1)
    drift_deg = math.remainder(heading_deg(core, gyro), 360.0)
    sigma_deg = 60.0 * 1.6 / math.sqrt(WINDOW) / LSB_PER_DEG_S
    assert abs(drift_deg) < 4 * sigma_deg + 0.02


def test_driving_or_being_turned_or_an_impossible_bias_is_no_calibration(core: ctypes.CDLL) -> None:
    for readings in (
        [(number % 3, number % 1000 != 999) for number in range(5000)],  # it drives now and then
        [(number // 5, True) for number in range(3000)],  # turned faster and faster
        [(700 + number % 3, True) for number in range(3000)],  # turned at 21 deg/s
        [(-700 + number % 3, True) for number in range(3000)],
        [(500 * (number % 2), True) for number in range(3000)],  # shaken
    ):
        gyro = core.gyro_new()
        for rate, stationary in readings:
            assert core.gyro_measure(gyro, rate, stationary)
        assert not core.gyro_calibrated(gyro), readings[1]


def test_a_reading_that_never_changes_is_a_failure(core: ctypes.CDLL) -> None:
    gyro = core.gyro_new()
    assert core.gyro_measure(gyro, 5, 1)
    assert [core.gyro_measure(gyro, 7, 1) for _ in range(103)] == [1] * 100 + [0] * 3
    assert core.gyro_measure(gyro, 6, 1)


def test_it_keeps_its_bias_and_takes_a_new_one_at_the_next_stop(core: ctypes.CDLL) -> None:
    gyro = calibrate(core, 100.0)
    for number in range(5000):
        core.gyro_measure(gyro, 200 + number % 2, 0)
    before = core.gyro_heading(gyro)
    core.gyro_measure(gyro, 100, 0)
    for _ in range(100):
        core.gyro_advance(gyro, 100)
    assert abs(core.gyro_heading(gyro) - before) < 10
    for number in range(2 * WINDOW):
        core.gyro_measure(gyro, 150 + number % 2, 1)
    before = core.gyro_heading(gyro)
    core.gyro_measure(gyro, 150, 0)
    for _ in range(100):
        core.gyro_advance(gyro, 10)
    turned = (core.gyro_heading(gyro) - before + 2**15) % 2**16 - 2**15
    assert turned == pytest.approx(-0.5 / LSB_PER_DEG_S * 65536 / 360, abs=2)


@pytest.mark.parametrize(("low", "high", "calibrates"), [(0, 33, True), (0, 34, False), (-33, 0, True)])
@pytest.mark.parametrize("first", [0, 500])
def test_readings_may_spread_by_a_degree_per_second(
    core: ctypes.CDLL, low: int, high: int, calibrates: bool, first: int
) -> None:
    gyro = core.gyro_new()
    core.gyro_measure(gyro, first, 0)
    for number in range(WINDOW):
        core.gyro_measure(gyro, first + (low, 0, high, 0)[number % 4], 1)
    assert core.gyro_calibrated(gyro) == calibrates


@pytest.mark.parametrize("bias", [656, -656])
def test_the_largest_bias_is_20_degrees_per_second(core: ctypes.CDLL, bias: int) -> None:
    away = 1 if bias > 0 else -1
    for step, calibrates in ((-away, True), (away, False)):
        gyro = core.gyro_new()
        core.gyro_measure(gyro, bias, 0)
        for number in range(WINDOW):
            core.gyro_measure(gyro, bias + step * (number % 2), 1)
        assert core.gyro_calibrated(gyro) == calibrates


@pytest.mark.parametrize("driven_before", [False, True])
def test_the_heading_starts_at_zero_and_loses_no_turn(core: ctypes.CDLL, driven_before: bool) -> None:
    """Without a bias it rests. A bias of 1/1024 LSB turns it backwards from the first millisecond."""
    noise = [1, -1] * (WINDOW // 2 - 1)
    for last_two, heading in (([0, 0], 0), ([1, 0], 0xFFFF)):
        gyro = core.gyro_new()
        core.gyro_advance(gyro, 255)
        assert core.gyro_heading(gyro) == 0, "no reading yet"
        if driven_before:
            core.gyro_measure(gyro, 0, 0)
        for rate in [*noise, *last_two]:
            assert not core.gyro_calibrated(gyro)
            core.gyro_measure(gyro, rate, 1)
        assert core.gyro_calibrated(gyro)
        core.gyro_advance(gyro, 1)
        assert core.gyro_heading(gyro) == heading


def test_a_gyroscope_that_only_ever_reads_zero_has_failed(core: ctypes.CDLL) -> None:
    gyro = core.gyro_new()
    assert [core.gyro_measure(gyro, 0, 1) for _ in range(101)] == [1] * 100 + [0]
