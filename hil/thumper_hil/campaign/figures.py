"""Draw a campaign's results: the value of every run, and each group's mean with its interval."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from thumper.cli.output.run_report import INK
from thumper.common.colours import BLUE, ORANGE
from thumper.maps.plot import save_figure
from thumper_hil.campaign.result_row import MEASURES, CampaignRow
from thumper_hil.campaign.summary import MIN_RUNS, Summary


def draw(path: Path, rows: Sequence[CampaignRow], summaries: Sequence[Summary]) -> Path:
    """Draw one panel per measure with one column per group."""
    measures = list(summaries[0].means)
    figure = Figure(figsize=(4.2 * len(measures), 4.5), layout="constrained")
    few = any(s.reached < MIN_RUNS for s in summaries)
    label = f"mean, {'range' if few else '95 %'}; crosses: goal not reached, not in the mean"
    labels = [f"{s.mission}\n{s.parameters}" for s in summaries]
    at = np.arange(len(summaries))
    for axes, name in zip(figure.subplots(1, len(measures), squeeze=False)[0], measures, strict=True):
        for k, s in enumerate(summaries):
            chosen = [row for row in rows if (row.mission, row.parameters) == (s.mission, s.parameters)]
            values = np.array([getattr(row, name) for row in chosen], dtype=np.float64)
            reached = np.array([row.reached for row in chosen])
            x = k + (np.linspace(-0.18, 0.18, len(chosen)) if len(chosen) > 1 else np.zeros(1))
            axes.plot(x[reached], values[reached], ".", color=BLUE, alpha=0.5)
            axes.plot(x[~reached], values[~reached], "x", color=INK, alpha=0.5)
        means = [s.means[name] for s in summaries]
        middle = np.array([m.value for m in means])
        errors = np.abs(np.array([[m.low for m in means], [m.high for m in means]]) - middle)
        axes.errorbar(at, middle, yerr=errors, fmt="o", color=ORANGE, capsize=5, label=label)
        axes.set_xticks(at, labels, rotation=30, ha="right", fontsize=8)
        axes.set_title(MEASURES[name], fontsize=10)
        axes.margins(y=0.1)
        if name != "speed_error_mean_rad_s":  # the only measure that can be negative
            axes.set_ylim(bottom=0.0)
        axes.set_xlim(-0.6, len(summaries) - 0.4)
        axes.grid(axis="y", alpha=0.3)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower right")
    save_figure(figure, path, 110)
    return path
