"""Experiment 8.2: set-point minus measured speed on a straight drive, compared with the thesis."""

import math
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from thumper.board.board import Board
from thumper_tuning.calibration.figures import draw_speed
from thumper_tuning.drive.board_gains import read_gains
from thumper_tuning.drive.console import LANE_WIDTH_M, confirm_room, progress_bar
from thumper_tuning.drive.verify import TrackingError, VerifyOptions, verify

THESIS_MEAN_RAD_S, THESIS_STD_RAD_S = -0.04, 0.31


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedResult:
    """The tracking error of one ramp, and the smallest one possible."""

    tracking: TrackingError
    quantization_std_rad_s: float  # std that counting alone causes, whatever the loop does

    @property
    def share(self) -> float:
        """0 at the quantization limit, 1 at the thesis's standard deviation."""
        span = THESIS_STD_RAD_S - self.quantization_std_rad_s
        return (self.tracking.std_rad_s - self.quantization_std_rad_s) / span


def quantization_std_rad_s(counts_per_rev: int, rate_Hz: int) -> float:
    """Return the std of the difference of two roundings to whole counts, as a speed over a tick."""
    return math.tau / counts_per_rev * rate_Hz / math.sqrt(6.0)


def run_speed_experiment(
    board: Board, options: VerifyOptions, out: Path, console: Console, *, yes: bool
) -> list[SpeedResult]:
    """Drive with the board's own gains; write speed.csv and speed.png, print *thesis | ours | limits*.

    Raises
    ------
    ThumperError
        Not confirmed, or the board fails.
    """
    lane_m = options.lane_m(board.identity.wheel_radius_mm / 1000.0)
    confirm_room(f"a lane {LANE_WIDTH_M:g} m wide, {lane_m:.1f} m ahead", console, yes=yes)
    with progress_bar(console, "speed") as report_progress:
        verification = verify(board, read_gains(board), options, out / "speed.csv", report_progress)
    limit = quantization_std_rad_s(board.identity.counts_per_rev, board.identity.control_rate_Hz)
    results = [SpeedResult(tracking=t, quantization_std_rad_s=limit) for t in verification.tracking]
    _print_table(results, console)
    console.print(f"wrote {draw_speed(verification, out / 'speed.png')}")
    return results


def _print_table(results: list[SpeedResult], console: Console) -> None:
    tracks = [result.tracking for result in results]
    table = Table(
        "set-point - measured, rad/s", "thesis", *[f"ours, {t.acceleration_rad_s2:g} rad/s^2" for t in tracks]
    )
    table.add_row("mean", f"{THESIS_MEAN_RAD_S:+.2f}", *[f"{t.mean_rad_s:+.3f}" for t in tracks])
    table.add_row("std", f"{THESIS_STD_RAD_S:.2f}", *[f"{t.std_rad_s:.3f}" for t in tracks])
    table.add_row("maximum", "", *[f"{t.max_rad_s:.2f}" for t in tracks])
    table.add_row("limit without preview", "", *[f"{t.no_preview_std_rad_s:.2f}" for t in tracks])
    table.add_row("limit of the counting", "", *[f"{r.quantization_std_rad_s:.3f}" for r in results])
    table.add_row(
        "position between that limit and the thesis", "", *[f"{100.0 * r.share:.0f} %" for r in results]
    )
    console.print(table)
