"""Summarize rows with confidence intervals, per mission and parameter set. Pure functions."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import bootstrap

from thumper_hil.campaign.result_row import MEASURES, CampaignRow, succeeded

CONFIDENCE = 0.95
Z = 1.959964  # of the normal distribution, two-sided 95 %

MIN_RUNS = 5
"""With fewer drives the summary shows the range instead of a confidence interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A value with its 95 % confidence interval; with fewer than `MIN_RUNS` drives, its range."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Statistics over the seeds of one mission with one parameter set."""

    mission: str
    parameters: str
    runs: int
    success: Interval  # share of the runs that reached the goal without a contact
    contacts: int
    touches_by_people: int
    reached: int
    means: dict[str, Interval]  # over the runs that reached the goal


def summarise(rows: Sequence[CampaignRow], measures: Sequence[str]) -> list[Summary]:
    """Return one summary per mission and parameter set, in the order of first appearance."""
    summaries = []
    for mission, parameters in dict.fromkeys((row.mission, row.parameters) for row in rows):
        chosen = [row for row in rows if (row.mission, row.parameters) == (mission, parameters)]
        summaries.append(
            Summary(
                mission=mission,
                parameters=parameters,
                runs=len(chosen),
                success=wilson(sum(map(succeeded, chosen)), len(chosen)),
                contacts=sum(row.contacts for row in chosen),
                touches_by_people=sum(row.touches_by_people for row in chosen),
                reached=sum(row.reached for row in chosen),
                means={
                    name: mean_interval([getattr(row, name) for row in chosen if row.reached])
                    for name in measures
                },
            )
        )
    return summaries


def wilson(hits: int, runs: int) -> Interval:
    """Return a share's score interval (Wilson 1927), which holds for few runs and for shares of 0 and 1."""
    share = hits / runs
    middle = (share + Z**2 / (2 * runs)) / (1 + Z**2 / runs)
    half = Z / (1 + Z**2 / runs) * math.sqrt(share * (1 - share) / runs + Z**2 / (4 * runs**2))
    return Interval(value=share, low=max(middle - half, 0.0), high=min(middle + half, 1.0))


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the mean of the finite values and its bootstrap interval (BCa, Efron 1987), or NaN."""
    known = np.array([value for value in values if math.isfinite(value)])
    if known.size == 0:
        return Interval(value=math.nan, low=math.nan, high=math.nan)
    mean = float(known.mean())
    if known.size < MIN_RUNS or float(np.ptp(known)) == 0.0:
        return Interval(value=mean, low=float(known.min()), high=float(known.max()))
    found = bootstrap(
        (known,), np.mean, confidence_level=CONFIDENCE, n_resamples=2000, method="BCa", rng=0
    ).confidence_interval
    return Interval(value=mean, low=float(found.low), high=float(found.high))


def markdown(summaries: Sequence[Summary], presets: Mapping[str, str]) -> str:
    """Return a table with one line per summary; there must be at least one.

    `presets` has the simulated robot's preset of each parameter set. Touches by people get a column if there
    are any.
    """
    touched = any(s.touches_by_people for s in summaries)
    headings = ["mission", "parameters", "preset", "runs", "success", "contacts"]
    headings += ["touches by people"] * touched
    headings += [MEASURES[name] for name in summaries[0].means]
    lines = [f"| {' | '.join(headings)} |", "|---" * len(headings) + "|"]
    for s in summaries:
        share = f"{s.success.value:.0%} ({s.success.low:.0%} ... {s.success.high:.0%})"
        cells = [s.mission, s.parameters, presets[s.parameters], str(s.runs), share, str(s.contacts)]
        cells += [str(s.touches_by_people)] * touched
        cells += [_cell(mean) for mean in s.means.values()]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(
        [
            *lines,
            "",
            "Brackets show 95 % confidence intervals (shares: Wilson; means: bootstrap), or the minimum and "
            f"maximum for a mean over fewer than {MIN_RUNS} drives. Means are over the drives that reached "
            "their goal.",
            "",
        ]
    )


def _cell(mean: Interval) -> str:
    return f"{mean.value:.3g} ({mean.low:.3g} ... {mean.high:.3g})" if math.isfinite(mean.value) else "-"
