"""Fused position: simulated receiver and driver, odometry with the errors of wheels and a gyroscope."""

import pytest
from benchmarks.shared.gps_drive import drive, rms_m

from tests.variants import some_of


@pytest.mark.parametrize("seed", some_of([1, 2, 3]))
def test_with_rtk_the_error_is_below_5_cm_and_as_large_as_the_filter_says(seed: int) -> None:
    found = drive("rtk", 5, seed)
    assert found.rms_m() < 0.05
    assert found.rejected < 0.02 * found.fixes


@pytest.mark.slow
def test_without_corrections_it_is_better_than_the_positions() -> None:
    found = [drive("sbas", 1, seed) for seed in (1, 2, 3, 4)]
    assert rms_m([each.rms_m() for each in found]) < rms_m([each.raw_rms_m() for each in found])


def test_it_drives_through_20_s_without_a_fix() -> None:
    assert drive("rtk", 5, 2, blocked_s=(120.0, 140.0)).largest_m(120.0, 140.0) < 0.5


def test_positions_that_jump_are_rejected() -> None:
    found = drive("rtk", 5, 3, shifted_s=(120.0, 135.0))
    assert found.largest_m(120.0, 140.0) < 0.3
    assert found.rejected >= 70


def test_a_filter_that_was_carried_away_starts_again() -> None:
    found = drive("rtk", 5, 4, shifted_s=(100.0, 1000.0), shift_m=3.0)  # from its view: all others are right
    assert found.errors_m[-1] == pytest.approx(3.0, abs=0.2)
