"""The clock filter follows a device's clock through delays, wraps and drift."""

import random

import pytest

from thumper.board.clock import ClockFilter

WRAP = 2**32


def test_delays_do_not_shift_the_stamps() -> None:
    """Messages are late by up to 30 ms; after the first fast one the stamps are right to 1 ms."""
    rng = random.Random(1)
    clock = ClockFilter(tick_s=1e-6, wrap_ticks=WRAP)
    start_ticks = WRAP - 3_000_000  # wraps after 3 s
    for k in range(200):
        true_s = 50.0 + 0.1 * k
        delay_s = 0.0005 if k % 20 == 5 else rng.uniform(0.0005, 0.03)
        stamp_s = clock.host_time_s((start_ticks + 100_000 * k) % WRAP, true_s + delay_s)
        if k > 5:
            assert stamp_s == pytest.approx(true_s + 0.0005, abs=1.1e-3 * 2.0)


def test_it_follows_the_drift_of_the_device_clock() -> None:
    """A ceramic resonator that is 0.05 % slow must not let the stamps fall behind."""
    clock = ClockFilter(tick_s=1e-6, wrap_ticks=WRAP)
    for k in range(5_000):
        true_s = 0.1 * k
        stamp_s = clock.host_time_s(round(true_s * 0.9995e6), true_s)
        assert stamp_s == pytest.approx(true_s, abs=1e-3)


def test_it_follows_a_device_clock_that_stood_still() -> None:
    clock = ClockFilter(tick_s=1e-6, wrap_ticks=WRAP)
    for k in range(100):
        true_s = 0.1 * k + (0.56 if k > 50 else 0.0)
        stamp_s = clock.host_time_s(100_000 * k, true_s + 0.002)
        if not 50 < k < 75:
            assert stamp_s == pytest.approx(true_s, abs=0.01)


def test_a_busy_host_does_not_shift_the_stamps() -> None:
    """It reads ten messages at once, each second; the newest of them is in time."""
    clock = ClockFilter(tick_s=1e-6, wrap_ticks=WRAP)
    for k in range(200):
        stamp_s = clock.host_time_s(100_000 * k, 0.1 * (k - k % 10 + 10))
        if k > 10:
            assert stamp_s == pytest.approx(0.1 * (k + 1), abs=0.02)
