"""Defective scans are counted and named."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from thumper.lidar.scan import Scan
from thumper.lidar.scan_checks import ScanChecker, ScanDefect


def scan(time_s: float, ranges_m: float = 1.0) -> Scan:
    return Scan(time_s=time_s, ranges_m=np.full(30, ranges_m), angle_min_rad=0.0, angle_increment_rad=0.1)


@pytest.mark.parametrize(
    ("after", "defect"),
    [
        (scan(0.25), ScanDefect.BACKWARDS),
        (scan(0.301), ScanDefect.BURST),
        (scan(0.1 * 3), ScanDefect.DUPLICATE),
        (scan(3.0), ScanDefect.GAP),
        (scan(math.nan), ScanDefect.STAMP),
        (scan(0.4, math.nan), ScanDefect.EMPTY),
    ],
)
def test_each_defect_is_counted_once_and_named(after: Scan, defect: ScanDefect) -> None:
    checker = ScanChecker()
    for k in range(4):
        assert checker.check(scan(0.1 * k)) == []
    assert checker.check(after) == [defect]
    assert checker.counts == {defect: 1}
    longest = " (the longest 2.7 s)" if defect is ScanDefect.GAP else ""
    assert checker.summary_lines() == [f"1 of 5 scans {defect.value}{longest}"]


@pytest.mark.parametrize(
    "broken",
    [
        {"ranges_m": np.empty(0)},
        {"angle_increment_rad": 0.0},
        {"angle_increment_rad": math.nan},
        {"angle_min_rad": math.inf},
        {"time_increment_s": math.nan},
    ],
)
def test_scans_without_beams_or_directions_are_named(broken: dict[str, Any]) -> None:
    assert ScanChecker().check(replace(scan(0.0), **broken)) == [ScanDefect.BEAMS]


def test_a_slower_rate_is_not_a_series_of_gaps() -> None:
    """A recording may hold every scan of its first part and every tenth of the rest."""
    checker = ScanChecker()
    for time_s in [*np.arange(0.0, 2.0, 0.1), *np.arange(2.0, 60.0, 1.2)]:
        checker.check(scan(float(time_s)))
    assert checker.counts == {ScanDefect.GAP: 6}  # until most of the last eleven steps are of the new rate


def test_zeros_are_named() -> None:
    assert ScanChecker().check(scan(0.0, 0.0)) == [ScanDefect.ZEROS, ScanDefect.EMPTY]


def test_the_period_survives_a_gap_and_a_step_back() -> None:
    checker = ScanChecker()
    for time_s in (0.0, 0.1, 0.2, 5.0, 5.1, 4.0, 4.1, 4.2):
        checker.check(scan(time_s))
    assert checker.counts == {ScanDefect.GAP: 1, ScanDefect.BACKWARDS: 1}
