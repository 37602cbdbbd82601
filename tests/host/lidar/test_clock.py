"""The lidar's clock is mapped to the host's; checked with clocks of known relation."""

import pytest

from thumper.lidar.clock import ClockSync

WRAP_MS = 1 << 24
LEAST_LAG_S = 0.07


def worst_error_s(
    *, synced: bool, drift: float, host_period_s: float, scans: int = 6000, first_ms: int = 5, skip: int = 0
) -> float:
    """Feed a scan every 98.2 ms, read at the host's next poll; return the worst error after `skip`."""
    sync = ClockSync(wrap_ms=WRAP_MS, least_lag_s=LEAST_LAG_S)
    if synced:
        sync.sync(first_ms, 9.999, 10.001)
    worst_s = 0.0
    for k in range(scans):
        true_s = 10.0 + 0.0982 * k
        stamp_ms = round(first_ms + 1000.0 * (1.0 + drift) * (true_s - 10.0)) % WRAP_MS
        polls = -(-(true_s + LEAST_LAG_S + 0.004) // host_period_s)
        error_s = abs(sync.host_time_s(stamp_ms, polls * host_period_s) - true_s)
        if k >= skip:
            worst_s = max(worst_s, error_s)
    return worst_s


@pytest.mark.parametrize("drift", [-1e-4, 0.0, 1e-4])
@pytest.mark.parametrize("host_period_s", [0.02, 0.1])
def test_it_follows_ten_minutes_of_drift(drift: float, host_period_s: float) -> None:
    """1e-4 over ten minutes is 60 ms; the error stays within a window's drift and the poll period."""
    assert worst_error_s(synced=True, drift=drift, host_period_s=host_period_s) < 0.008


def test_a_host_in_phase_with_the_lidar_does_not_bias_the_stamps() -> None:
    """Every scan waits the same 96 ms for the host; only `sync` can measure that."""
    assert worst_error_s(synced=True, drift=0.0, host_period_s=0.0982) < 0.002
    assert worst_error_s(synced=False, drift=0.0, host_period_s=0.0982) > 0.01


def test_without_sync_it_uses_the_minimum_lag() -> None:
    assert worst_error_s(synced=False, drift=0.0, host_period_s=0.02, skip=100) < 0.008


def test_the_clock_may_wrap() -> None:
    assert worst_error_s(synced=True, drift=0.0, host_period_s=0.02, first_ms=WRAP_MS - 2000) < 0.008


def test_a_restarted_lidar_is_synchronized_again() -> None:
    sync = ClockSync(wrap_ms=WRAP_MS, least_lag_s=LEAST_LAG_S)
    sync.sync(3_600_000, 9.999, 10.001)
    assert sync.host_time_s(3_600_100, 10.2) == pytest.approx(10.1, abs=0.001)
    assert sync.host_time_s(40, 12.0) == pytest.approx(12.0 - LEAST_LAG_S)


def test_scans_queued_during_a_host_stall_keep_their_stamps() -> None:
    sync = ClockSync(wrap_ms=WRAP_MS, least_lag_s=LEAST_LAG_S)
    sync.sync(1000, 9.999, 10.001)
    stamps_s = [sync.host_time_s(1000 + 100 * k, 14.0) for k in range(1, 31)]
    assert stamps_s == pytest.approx([10.0 + 0.1 * k for k in range(1, 31)], abs=0.002)


@pytest.mark.parametrize("synced", [True, False])
@pytest.mark.parametrize("slip_s", [0.56, -4.0, 3.0])
@pytest.mark.parametrize("after", [0, 40, 400])
def test_it_follows_a_clock_that_stood_still_or_went_on_without_the_host(
    synced: bool, slip_s: float, after: int
) -> None:
    """The lidar, or the computer, was suspended for a moment; `after` scans came before."""
    sync = ClockSync(wrap_ms=WRAP_MS, least_lag_s=LEAST_LAG_S)
    if synced:
        sync.sync(0, 9.999, 10.001)
    error_s = 1.0
    for k in range(after + 40):
        device_s = 0.0982 * (k + 1)
        true_s = 10.0 + device_s + (slip_s if k >= after else 0.0)
        polled_s = -(-(true_s + LEAST_LAG_S + 0.004) // 0.1) * 0.1
        error_s = abs(sync.host_time_s(round(1e3 * device_s), polled_s) - true_s)
    assert error_s < 0.11  # the poll period
