"""Measurements to verdicts: each defect gets its verdict and its fix."""

import numpy as np
import pytest

from thumper.common.geometry import FloatArray
from thumper.doctor.verdicts import Limits, Stream, judge_battery, judge_round_trip, judge_spin, judge_stream

JITTER = Limits(warn_s=0.02, fail_s=0.15)


def verdicts(times_s: FloatArray, *, late_s: FloatArray | float = 0.001, damaged: int = 0) -> list[str]:
    stream = Stream(times_s=times_s, arrivals_s=times_s + late_s, expected_Hz=10.0, damaged=damaged)
    return [check.verdict for check in judge_stream("telemetry", stream, JITTER)]


def test_a_good_stream_passes() -> None:
    assert verdicts(np.arange(30) / 10.0) == ["pass", "pass", "pass"]


def test_one_loss_warns_many_fail_and_the_rate_stays() -> None:
    times_s = np.arange(100) / 10.0
    assert verdicts(np.delete(times_s, 50)) == ["pass", "warn", "pass"]
    assert verdicts(np.delete(times_s, range(40, 50))) == ["pass", "fail", "pass"]
    assert verdicts(times_s, damaged=1) == ["pass", "warn", "pass"]


def test_a_wrong_rate_is_reported() -> None:
    assert verdicts(np.arange(30) / 9.5)[0] == "warn"
    assert verdicts(np.arange(30) / 8.0)[0] == "fail"


def test_jitter_is_the_variation_of_the_delay() -> None:
    times_s = np.arange(30) / 10.0
    assert verdicts(times_s, late_s=0.3)[2] == "pass"
    late_s = np.where(np.arange(30) % 5 == 0, 0.05, 0.0)
    assert verdicts(times_s, late_s=late_s)[2] == "warn"
    assert verdicts(times_s, late_s=5.0 * late_s)[2] == "fail"


def test_silence_fails() -> None:
    assert verdicts(np.array([])) == ["fail"]
    assert judge_round_trip("board", [], 20, 0.04, 0.15).verdict == "fail"


@pytest.mark.parametrize(
    ("trips_s", "lost", "verdict"),
    [
        ([0.002] * 20, 0, "pass"),
        ([0.002] * 19 + [0.06], 0, "warn"),
        ([0.002] * 49, 1, "warn"),
        ([0.002] * 48, 2, "fail"),
        ([0.2] * 20, 0, "fail"),
    ],
)
def test_round_trips(trips_s: list[float], lost: int, verdict: str) -> None:
    assert judge_round_trip("board", trips_s, lost, 0.04, 0.15).verdict == verdict


@pytest.mark.parametrize(
    ("battery_V", "verdict", "fix"),
    [
        (0.0, "fail", "connect the battery"),
        (10.4, "fail", "stops at 9.0 V, then waits for 10.5 V"),
        (10.6, "warn", "stops at 9.0 V under load"),
        (10.9, "pass", ""),
        (13.4, "pass", ""),
        (13.6, "fail", "too high for 3 cells"),
    ],
)
def test_battery(battery_V: float, verdict: str, fix: str) -> None:
    check = judge_battery(battery_V, cells=3, stop_V=9.0, rearm_V=10.5)
    assert (check.verdict, fix in check.fix) == (verdict, True)


@pytest.mark.parametrize(
    ("own", "other", "lost_edges", "fix"),
    [
        (200, 0, 0, ""),
        (200, 40, 0, ""),  # the other wheel is dragged along a little
        (-200, 0, 0, "exchange wires A and B"),
        (0, 200, 0, "exchange the plugs"),
        (0, -200, 0, "exchange the plugs"),
        (1, 0, 0, "dead"),
        (150, 0, 90, "loose or noisy"),
    ],
)
def test_each_encoder_fault_has_its_fix(own: int, other: int, lost_edges: int, fix: str) -> None:
    check = judge_spin("left", own, other, lost_edges)
    assert check.verdict == ("fail" if fix else "pass")
    assert fix in check.fix
    assert "left" in check.what
