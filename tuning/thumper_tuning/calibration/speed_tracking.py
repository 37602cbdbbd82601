"""Experiment 8.2: a straight drive, set-point minus measured speed, between the thesis and the floor."""

import math
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from thumper.board.board import Board
from thumper_tuning.calibration.figures import draw_speed
from thumper_tuning.cli.steps import LANE_WIDTH_M, bar, confirm_room
from thumper_tuning.drive.board_gains import read_gains
from thumper_tuning.drive.verify import Tracking, VerifyOptions, verify

THESIS_MEAN_RAD_S, THESIS_STD_RAD_S = -0.04, 0.31


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One ramp's result, and where it stands."""

    tracking: Tracking
    counting_floor_rad_s: float  # std that counting alone leaves, whatever the loop does

    @property
    def share(self) -> float:
        """0 at the counting floor, 1 at the thesis's standard deviation."""
        span = THESIS_STD_RAD_S - self.counting_floor_rad_s
        return (self.tracking.std_rad_s - self.counting_floor_rad_s) / span


def counting_floor_rad_s(counts_per_rev: int, rate_Hz: int) -> float:
    """Std of the difference of two roundings to whole counts, as a speed over a tick."""
    return math.tau / counts_per_rev * rate_Hz / math.sqrt(6.0)


def run(board: Board, options: VerifyOptions, out: Path, console: Console, *, yes: bool) -> list[Standing]:
    """Drive with the gains that the board has; leave speed.csv, speed.png; print *thesis | ours | floors*.

    Raises
    ------
    ThumperError
        Not confirmed, or the board fails.
    """
    lane_m = options.lane_m(board.identity.wheel_radius_mm / 1000.0)
    confirm_room(f"a lane {LANE_WIDTH_M:g} m wide, {lane_m:.1f} m ahead", console, yes=yes)
    with bar(console, "speed") as show:
        result = verify(board, read_gains(board), options, out / "speed.csv", show)
    floor = counting_floor_rad_s(board.identity.counts_per_rev, board.identity.control_rate_Hz)
    standings = [Standing(tracking=t, counting_floor_rad_s=floor) for t in result.tracking]
    _print(standings, console)
    console.print(f"{draw_speed(result, out / 'speed.png')} shows it")
    return standings


def _print(standings: list[Standing], console: Console) -> None:
    table = Table(
        "set-point - measured, rad/s",
        "thesis",
        *[f"ours, {s.tracking.acceleration_rad_s2:g} rad/s^2" for s in standings],
    )
    tracks = [s.tracking for s in standings]
    table.add_row("mean", f"{THESIS_MEAN_RAD_S:+.2f}", *[f"{t.mean_rad_s:+.3f}" for t in tracks])
    table.add_row("std", f"{THESIS_STD_RAD_S:.2f}", *[f"{t.std_rad_s:.3f}" for t in tracks])
    table.add_row("largest", "", *[f"{t.largest_rad_s:.2f}" for t in tracks])
    table.add_row("floor without preview", "", *[f"{t.floor_rad_s:.2f}" for t in tracks])
    table.add_row("floor of the counting", "", *[f"{s.counting_floor_rad_s:.3f}" for s in standings])
    table.add_row(
        "of the way from that floor to the thesis", "", *[f"{100.0 * s.share:.0f} %" for s in standings]
    )
    console.print(table)
