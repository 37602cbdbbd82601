"""The steps of `thumper tune` in the terminal: open the board, ask, run, print."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from thumper.board.messages import Command
from thumper_tuning.cli.gains_file import write_gains_file
from thumper_tuning.cli.procedure import BoardProcedure
from thumper_tuning.cli.settings import TuneOptions
from thumper_tuning.design.fixed_point import BoardGains
from thumper_tuning.design.gains import Design, DesignOptions, design, nominal_model
from thumper_tuning.drive.board_gains import original_gains, write_gains
from thumper_tuning.drive.console import LANE_WIDTH_M, confirm_room, open_board, progress_bar
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import ReportProgress, record
from thumper_tuning.drive.verify import VerifyOptions, verify
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.report.export import write_models
from thumper_tuning.report.page import write_report
from thumper_tuning.report.text import design_lines, motor_lines, tracking_lines

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleProgress:
    """Progress in the terminal: lines, and a bar below them."""

    console: Console
    report_progress: ReportProgress

    def report_line(self, line: str) -> None:
        """Print a line."""
        self.console.print(line, markup=False)

    def run_in_thread(self, work: Callable[[], T]) -> T:
        """Compute in this thread: there is nothing else to do."""
        return work()


def record_on(
    board_url: str, baud: int, out: Path, options: ExcitationOptions, *, yes: bool, console: Console
) -> None:
    """Drive the identification experiment."""
    with open_board(board_url, baud) as board:
        room = f"a lane {LANE_WIDTH_M:g} m wide, {options.lane_m:g} m ahead and as much behind"
        confirm_room(room, console, yes=yes)
        with progress_bar(console, "recording") as report_progress:
            path = record(board, options, out / "identification.csv", report_progress)
    console.print(f"wrote {path}; next: thumper tune fit {path}")


def design_from_motors(
    motors: list[IdentifiedMotor],
    out: Path,
    options: DesignOptions,
    battery_V: float | None,
    console: Console,
) -> Design:
    """Design gains, print them, and write gains.json and report.html."""
    result = design(*nominal_model(motors, battery_V), options)
    for line in design_lines(result):
        console.print(line, markup=False)
    path = write_gains_file(out / "gains.json", result)
    page = write_report(out / "report.html", motors, result)
    write_models(out, motors, result)
    console.print(f"wrote {path} and {page}; next: thumper tune verify {path} --board PORT")
    return result


def verify_on(
    board_url: str,
    baud: int,
    gains: BoardGains,
    out: Path,
    options: VerifyOptions,
    *,
    yes: bool,
    console: Console,
) -> None:
    """Drive the trapezoids with these gains and print the tracking error."""
    with open_board(board_url, baud) as board:
        lane_m = options.lane_m(board.identity.wheel_radius_mm / 1000.0)
        confirm_room(f"a lane {LANE_WIDTH_M:g} m wide, {lane_m:.1f} m ahead", console, yes=yes)
        with progress_bar(console, "verifying") as report_progress:
            result = verify(board, gains, options, out / "verify.csv", report_progress)
        for line in tracking_lines(result):
            console.print(line, markup=False)


def tune_robot(
    board_url: str, baud: int, out: Path, options: TuneOptions, *, yes: bool, console: Console
) -> None:
    """Run the whole procedure; save the new gains on the board if confirmed, with `yes` if they are better.

    If it is interrupted, the board gets its old gains back.
    """
    import typer

    with open_board(board_url, baud) as board:
        lane_m = options.verify.lane_m(board.identity.wheel_radius_mm / 1000.0)
        confirm_room(
            f"a lane {LANE_WIDTH_M:g} m wide, {max(options.excitation.lane_m, lane_m):.1f} m ahead and "
            f"{options.excitation.lane_m:.1f} m behind",
            console,
            yes=yes,
        )
        with original_gains(board) as old:
            with progress_bar(console) as report_progress:
                progress = ConsoleProgress(console=console, report_progress=report_progress)
                procedure = BoardProcedure(board=board, folder=out, progress=progress, motor_text=motor_lines)
                tuning = procedure.tune(options, old)
            keep = tuning.better
            if not yes:
                keep = typer.confirm("Save the new gains on the board?", default=keep)
        if keep:
            board.command(Command.SAVE)
            outcome = "saved the new gains on the board"
        else:
            write_gains(board, old)
            outcome = "restored the old gains"
            if not tuning.better:
                outcome = "kept the old gains, which suit this robot: the new ones track no better"
        console.print(f"{outcome}; see {tuning.report}")
