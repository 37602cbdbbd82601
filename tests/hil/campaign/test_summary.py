"""Success rates, means and their confidence intervals."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.hil.campaign.samples import row
from thumper_hil.campaign.summary import markdown, mean_interval, summarise, wilson

PRESETS = {"p": "nominal", "hard": "hard"}


def test_intervals_have_their_nominal_coverage() -> None:
    """About 95 of 100 intervals contain the true value."""
    rng = np.random.default_rng(1)
    means = [mean_interval(list(rng.normal(3.0, 1.0, 30))) for _ in range(100)]
    assert 88 <= sum(m.low < 3.0 < m.high for m in means) <= 100
    shares = [wilson(int(rng.binomial(40, 0.9)), 40) for _ in range(300)]
    assert 270 <= sum(s.low < 0.9 < s.high for s in shares) <= 300
    assert wilson(10, 10).high == pytest.approx(1.0)
    assert wilson(10, 10).low == pytest.approx(0.722, abs=0.001)
    assert math.isnan(mean_interval([math.nan]).value)
    three = mean_interval([2.0, 1.0, 6.0])  # too few for a confidence interval: the range
    assert (three.value, three.low, three.high) == (3.0, 1.0, 6.0)


def test_drive_with_a_contact_is_not_a_success() -> None:
    summary = summarise([row("a"), row("b", contacts=2), row("c", reached=False)], ["time_s"])[0]
    assert (summary.runs, summary.contacts) == (3, 2)
    assert summary.success.value == pytest.approx(1 / 3)


def test_touches_by_people_are_summed_in_a_column_of_their_own() -> None:
    summaries = summarise([row("a", touches_by_people=2), row("b", touches_by_people=1)], ["time_s"])
    assert summaries[0].success.value == 1.0
    headings, _, cells = (line.split(" | ") for line in markdown(summaries, PRESETS).splitlines()[:3])
    assert cells[headings.index("touches by people")] == "3"
    assert "touches by people" not in markdown(summarise([row("a")], ["time_s"]), PRESETS)


def test_means_exclude_drives_that_missed_the_goal() -> None:
    rows = [row("a"), row("b", reached=False, time_s=99.0)]
    assert summarise(rows, ["time_s"])[0].means["time_s"].value == pytest.approx(0.25)
    assert "reached their goal" in markdown(summarise(rows, ["time_s"]), PRESETS)


def test_missing_mean_is_printed_as_a_dash() -> None:
    assert (
        markdown(summarise([row("b", reached=False)], ["time_s"]), PRESETS).splitlines()[2].endswith("| - |")
    )


def test_table_says_which_preset_was_driven() -> None:
    easy, hard = row("a"), replace(row("b"), parameters="hard")
    lines = markdown(summarise([easy, hard], ["time_s"]), PRESETS).splitlines()
    assert [line.split(" | ")[1:3] for line in lines[2:4]] == [["p", "nominal"], ["hard", "hard"]]
