"""`thumper demo --seeds`: its statistics, its result, and its files."""

import csv
import dataclasses
from pathlib import Path

import pytest
from rich.console import Console

from thumper_hil.demo.repeat import GOAL_ERROR_LIMIT_M, DriveRow, mission_statistics, run_seeds

GOOD = DriveRow(
    seed=1,
    mission="straight",
    reached=True,
    goal_error_m=0.04,
    contacts=0,
    time_s=9.0,
    path_length_m=2.2,
    reason="",
)


def test_drive_passes_only_near_the_goal_and_without_contact() -> None:
    assert GOOD.passed
    for fault in (
        {"reached": False},
        {"contacts": 1},
        {"goal_error_m": GOAL_ERROR_LIMIT_M + 0.001},
    ):
        assert not dataclasses.replace(GOOD, **fault).passed


def test_statistics_are_per_mission() -> None:
    far = dataclasses.replace(GOOD, seed=2, goal_error_m=0.12, contacts=2, time_s=11.0)
    box = dataclasses.replace(GOOD, mission="box")
    straight, other = mission_statistics([GOOD, box, far])
    assert (straight.mission, straight.runs, straight.passed, straight.contacts) == ("straight", 2, 1, 2)
    assert straight.error_mean_m == pytest.approx(0.08)
    assert straight.error_max_m == pytest.approx(0.12)
    assert (straight.time_mean_s, straight.time_max_s) == pytest.approx((10.0, 11.0))
    assert (other.mission, other.runs, other.passed) == ("box", 1, 1)


@pytest.mark.slow
def test_both_missions_pass_and_are_written(tmp_path: Path) -> None:
    assert run_seeds(tmp_path, first_seed=21, seeds=1, console=Console(quiet=True))
    with (tmp_path / "experiment.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["seed"], row["mission"], row["reached"]) for row in rows] == [
        ("21", "straight", "True"),
        ("21", "box", "True"),
    ]
    assert all(float(row["goal_error_m"]) <= GOAL_ERROR_LIMIT_M for row in rows)
    table = (tmp_path / "experiment.md").read_text()
    assert "| straight | 1 of 1 |" in table
    assert (tmp_path / "experiment.png").stat().st_size > 10_000
