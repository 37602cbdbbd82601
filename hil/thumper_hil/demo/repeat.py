"""Repeat the demo's missions with many seeds: statistics of the thesis's experiment 8.3 (Švec 2019)."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from thumper.common.colours import BLUE, GREEN, ORANGE
from thumper.common.files import write_csv, write_text
from thumper.maps.plot import draw_grid, save_figure
from thumper_hil.demo.missions import MISSIONS
from thumper_hil.demo.outcome import Outcome
from thumper_hil.demo.run import drive_mission, load_kernels

GOAL_ERROR_LIMIT_M = 0.10  # a quarter of the thesis's tolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRow:
    """One mission with one seed; a row of experiment.csv."""

    seed: int
    mission: str
    reached: bool
    goal_error_m: float  # ground truth
    contacts: int  # ground truth
    time_s: float
    path_length_m: float
    reason: str

    @property
    def passed(self) -> bool:
        """True if the robot reached the goal within `GOAL_ERROR_LIMIT_M` without a contact."""
        return self.reached and self.goal_error_m <= GOAL_ERROR_LIMIT_M and self.contacts == 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStatistic:
    """Statistics over all seeds of one mission."""

    mission: str
    runs: int
    passed: int
    error_mean_m: float
    error_max_m: float
    contacts: int
    time_mean_s: float
    time_max_s: float


def run_seeds(out: Path, *, first_seed: int, seeds: int, console: Console, preset: str = "nominal") -> bool:
    """Drive every mission with `seeds` seeds, write the results to `out`; return True if all passed."""
    load_kernels(console)
    rows: list[DriveRow] = []
    outcomes: list[Outcome] = []
    for seed in range(first_seed, first_seed + seeds):
        for mission in MISSIONS:
            outcome = drive_mission(
                mission, seed=seed, realtime=False, console=Console(quiet=True), preset=preset
            )
            rows.append(to_row(outcome, seed))
            outcomes.append(outcome)
            console.print(_line(rows[-1]), highlight=False)
    _write_csv(out / "experiment.csv", rows)
    statistics = mission_statistics(rows)
    write_text(out / "experiment.md", _markdown(statistics))
    _draw(out / "experiment.png", outcomes)
    _print_table(statistics, console)
    console.print(
        f"preset {preset}; in {out}/: experiment.csv, experiment.md, experiment.png", highlight=False
    )
    return all(row.passed for row in rows)


def to_row(outcome: Outcome, seed: int) -> DriveRow:
    """Return the CSV row of an outcome."""
    return DriveRow(
        seed=seed,
        mission=outcome.mission.name,
        reached=outcome.result.reached,
        goal_error_m=outcome.goal_error_m,
        contacts=outcome.collisions,
        time_s=outcome.result.time_s,
        path_length_m=outcome.result.path_length_m,
        reason=outcome.result.reason,
    )


def mission_statistics(rows: Sequence[DriveRow]) -> list[MissionStatistic]:
    """Summarize the rows by mission, in the order of first appearance."""
    statistics = []
    for name in dict.fromkeys(row.mission for row in rows):
        chosen = [row for row in rows if row.mission == name]
        errors_m = np.array([row.goal_error_m for row in chosen])
        times_s = np.array([row.time_s for row in chosen])
        statistics.append(
            MissionStatistic(
                mission=name,
                runs=len(chosen),
                passed=sum(row.passed for row in chosen),
                error_mean_m=float(errors_m.mean()),
                error_max_m=float(errors_m.max()),
                contacts=sum(row.contacts for row in chosen),
                time_mean_s=float(times_s.mean()),
                time_max_s=float(times_s.max()),
            )
        )
    return statistics


def _line(row: DriveRow) -> str:
    verdict = "passed" if row.passed else f"failed: {row.reason}"
    return (
        f"seed {row.seed}, {row.mission}: {row.goal_error_m:.3f} m from the goal, {row.contacts} contacts, "
        f"{row.time_s:.1f} s, {verdict}"
    )


def _cells(statistic: MissionStatistic) -> tuple[str, ...]:
    return (
        statistic.mission,
        f"{statistic.passed} of {statistic.runs}",
        f"{statistic.error_mean_m:.3f} / {statistic.error_max_m:.3f} m",
        str(statistic.contacts),
        f"{statistic.time_mean_s:.1f} / {statistic.time_max_s:.1f} s",
    )


HEADINGS = ("mission", "passed", "goal error, mean / worst", "contacts", "time, mean / longest")


def _markdown(statistics: Sequence[MissionStatistic]) -> str:
    lines = [f"| {' | '.join(HEADINGS)} |", "|---" * len(HEADINGS) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(_cells(s))} |" for s in statistics)]) + "\n"


def _print_table(statistics: Sequence[MissionStatistic], console: Console) -> None:
    table = Table(*HEADINGS)
    for statistic in statistics:
        table.add_row(*_cells(statistic))
    console.print(table)


def _write_csv(path: Path, rows: Sequence[DriveRow]) -> None:
    write_csv(path, [field.name for field in fields(DriveRow)], map(astuple, rows))


def _draw(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Draw one panel per mission: map and first plan of the last seed, true path of every seed."""
    figure = Figure(figsize=(7 * len(MISSIONS), 6.5), layout="constrained")
    for axes, mission in zip(figure.subplots(1, len(MISSIONS)), MISSIONS, strict=True):
        chosen = [outcome for outcome in outcomes if outcome.mission is mission]
        last = chosen[-1]
        draw_grid(axes, last.grid)
        for outcome in chosen:
            label = "ground truth (all seeds)" if outcome is last else None
            axes.plot(*outcome.truth[:, 1:3].T, color=GREEN, linewidth=0.8, alpha=0.6, label=label)
        if last.log.plans:
            axes.plot(*last.log.plans[0].T, "--", color=ORANGE, label="first plan (last seed)")
        axes.plot(*last.log.poses[:, 1:3].T, color=BLUE, linewidth=1.2, label="SLAM estimate (last seed)")
        axes.plot(mission.goal_x_m, mission.goal_y_m, "*", color=ORANGE, markersize=14, label="goal")
        worst_m = max(outcome.goal_error_m for outcome in chosen)
        axes.set_title(f"{mission.title}: {len(chosen)} seeds, at most {100 * worst_m:.1f} cm from the goal")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    save_figure(figure, path, 110)
