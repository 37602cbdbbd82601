"""Write the demo's results: summary.json, the table, the maps and the pictures."""

import hashlib
import json
import os
import platform
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from thumper.board.messages import SCHEMA_HASH
from thumper.cli.output.run_report import draw_speeds
from thumper.common.colours import GREEN, ORANGE, UNKNOWN_COLOUR
from thumper.common.files import write_text
from thumper.common.version import __version__
from thumper.maps.map_server_io import save_map
from thumper.maps.plot import draw_grid, save_figure
from thumper.robot.figure import draw_drive
from thumper.runtime.drive_log import path_length_m, speed_errors
from thumper.slam.saved_state import save_session
from thumper_hil.bench import DEFAULT_ELF
from thumper_hil.demo.missions import (
    STRAIGHT,
    THESIS_SPEED_ERROR_MEAN_RAD_S,
    THESIS_SPEED_ERROR_STD_RAD_S,
    TOLERANCE_M,
)
from thumper_hil.demo.outcome import Outcome

NEXT_STEPS = (  # command, what it shows
    ("demo --ui", "the same in the browser, in real time; then you drive the robot"),
    ("explore --board 'sim://?world=lab_box'", "the robot explores the room and comes back"),
    (
        "tune --board 'sim://?world=hall' --yes",
        "identify its motors; the gains that it has suit them already",
    ),
)
FILES = (  # of the results, what they hold
    ("missions.png", "both maps with the planned, driven and true path"),
    ("speed_control.png", "the wheel speeds"),
    ("map_straight.*, map_box.*", "the two maps; map.* is a copy of map_box.*"),
    ("recordings/", "recordings of both drives"),
    ("table.md, summary.json", "this table with its conditions; all figures"),
)
FOOTNOTE = (
    "Wheel speed error: ramped set-point of the firmware minus measured speed, straight run, while moving. "
    "`thumper tune` drives ramps without the navigator and shows less; docs/results/tuning.md compares."
)


def write_results(
    out: Path, outcomes: Sequence[Outcome], setting: Mapping[str, int | str], console: Console
) -> None:
    """Write everything to `out`, print the table and list the files; `setting` has `seed` and `preset`."""
    summary = summarize(outcomes, setting)
    write_text(out / "summary.json", json.dumps(summary, indent=2) + "\n")
    maps = [(f"map_{outcome.mission.name}", outcome) for outcome in outcomes]
    for name, outcome in (*maps, ("map", outcomes[-1])):
        save_map(outcome.grid, out / f"{name}.yaml")
        save_session(outcome.session, out / f"{name}.session")
    _picture_of_missions(out / "missions.png", outcomes)
    straight = next(outcome for outcome in outcomes if outcome.mission is STRAIGHT)
    figure = Figure(figsize=(9, 6), layout="constrained")
    draw_speeds(figure, straight.log.speeds, "wheel speed control on the straight run")
    save_figure(figure, out / "speed_control.png", 130)
    rows = table_rows(summary)
    speed = f"Preset {setting['preset']}; simulated at {summary['sim_speed_x_real_time']:.1f} x real time."
    write_text(out / "table.md", _markdown(rows, speed))
    _print_table(rows, console)
    worst_cm, required_cm = 100 * max(outcome.goal_error_m for outcome in outcomes), 100 * TOLERANCE_M
    best = (
        f"The robot stopped within {worst_cm:.1f} cm of its goals; the thesis required {required_cm:.0f} cm."
    )
    console.print(best, highlight=False, soft_wrap=True)
    console.print(f"\nResults in {out}/:", soft_wrap=True)
    for name, content in FILES:
        console.print(f"  {name:<29}{content}", highlight=False, soft_wrap=True)


def print_next_steps(console: Console, steps: Sequence[tuple[str, str]] = NEXT_STEPS) -> None:
    """Print what to try next, as commands to copy."""
    beside = os.path.relpath(Path(sys.executable).with_name("thumper"))
    program = "thumper" if shutil.which("thumper") else min(beside, os.path.abspath(beside), key=len)
    console.print("\nTry next:")
    for arguments, effect in steps:
        console.print(f"  {program} {arguments}", highlight=False, soft_wrap=True)
        console.print(f"      {effect}", highlight=False)
    console.print("  docs/tutorials/simulated.md has the next steps.", highlight=False)


def summarize(outcomes: Sequence[Outcome], setting: Mapping[str, int | str]) -> dict[str, Any]:
    """Return the content of summary.json; lengths in m, times in s, wheel speeds in rad/s."""
    straight = next(outcome for outcome in outcomes if outcome.mission is STRAIGHT)
    return {
        "missions": [
            {
                "name": outcome.mission.name,
                "reached": outcome.result.reached,
                "reason": outcome.result.reason,
                "goal_error_m": outcome.goal_error_m,
                "time_s": outcome.result.time_s,
                "collisions": outcome.collisions,
                "path_length_m": path_length_m(outcome.truth),
                "map_vs_truth": asdict(outcome.map_quality),
                "wheel_speed_error": _speed_errors(outcome),
            }
            for outcome in outcomes
        ],
        "wheel_speed_error": _speed_errors(straight),
        "map_vs_truth": asdict(outcomes[-1].map_quality),
        "sim_speed_x_real_time": sum(o.sim_time_s for o in outcomes) / sum(o.wall_time_s for o in outcomes),
        **setting,
        "versions": {
            "thumper": __version__,
            "protocol": f"{SCHEMA_HASH:08x}",
            "firmware_elf_sha256": hashlib.sha256(DEFAULT_ELF.read_bytes()).hexdigest(),
            "python": platform.python_version(),
            "numpy": version("numpy"),
            "numba": version("numba"),
        },
    }


def table_rows(summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return rows (quantity, our value, the thesis's value) as text."""
    rows = [
        (
            f"{mission['name']}: goal error",
            f"{mission['goal_error_m']:.3f} m",
            f"within {TOLERANCE_M} m",
        )
        for mission in summary["missions"]
    ]
    rows += [
        (f"{mission['name']}: collisions", str(mission["collisions"]), "0") for mission in summary["missions"]
    ]
    for side, error in summary["wheel_speed_error"].items():
        rows.append(
            (
                f"{side} wheel speed error, mean",
                f"{error['mean_rad_s']:+.3f} rad/s",
                f"{THESIS_SPEED_ERROR_MEAN_RAD_S:+.2f} rad/s",
            )
        )
        rows.append(
            (
                f"{side} wheel speed error, std",
                f"{error['std_rad_s']:.3f} rad/s",
                f"{THESIS_SPEED_ERROR_STD_RAD_S:.2f} rad/s",
            )
        )
    return rows


def _speed_errors(outcome: Outcome) -> dict[str, dict[str, float]]:
    return {side: asdict(error) for side, error in speed_errors(outcome.log.speeds).items()}


def _print_table(rows: list[tuple[str, str, str]], console: Console) -> None:
    table = Table("", "ours (simulated)", "thesis (real robot)")
    for row in rows:
        table.add_row(*row)
    console.print("\nThe same two missions in a bachelor thesis, with a real robot:")
    console.print(table)


def _markdown(rows: list[tuple[str, str, str]], speed: str) -> str:
    lines = ["| | ours (simulated) | thesis (real robot) |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows), "", speed, "", FOOTNOTE]) + "\n"


def _picture_of_missions(path: Path, outcomes: Sequence[Outcome]) -> None:
    figure = Figure(figsize=(4 * len(outcomes), 4.7), layout="constrained")
    columns = figure.subplots(1, len(outcomes), sharex=True, sharey=True)
    for axes, outcome in zip(columns, outcomes, strict=True):
        draw_grid(axes, outcome.grid)
        axes.set_facecolor(UNKNOWN_COLOUR)
        axes.label_outer()
        draw_drive(axes, outcome.log)
        mission, truth = outcome.mission, outcome.truth
        axes.plot(truth[:, 1], truth[:, 2], color=GREEN, linewidth=1.2, label="ground truth")
        axes.plot(mission.start.x_m, mission.start.y_m, "o", color=GREEN, markersize=8, label="start")
        axes.plot(mission.goal_x_m, mission.goal_y_m, "*", color=ORANGE, markersize=14, label="goal")
        error_cm = 100 * outcome.goal_error_m
        seconds = f"{outcome.result.time_s:.1f} s, {error_cm:.1f} cm from the goal"
        axes.set_title(f"{mission.title}\n{seconds}, {outcome.collisions} collisions", fontsize=11)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=10)
    save_figure(figure, path, 110)
