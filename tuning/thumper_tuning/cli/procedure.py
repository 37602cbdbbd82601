"""Tune the wheels of a board: record, identify, design, verify, report. Used by the command and the page."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar

from thumper.board.board import Board
from thumper_tuning.cli.gains_file import write_gains_file
from thumper_tuning.cli.settings import TuneOptions
from thumper_tuning.design.fixed_point import BoardGains
from thumper_tuning.design.gains import Design, DesignOptions, design, nominal_model
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import record
from thumper_tuning.drive.return_to_start import distance_m, return_to
from thumper_tuning.drive.verify import Verification, VerifyOptions, verify
from thumper_tuning.identify.motor import IdentifiedMotor, identify
from thumper_tuning.logs.read import read_runs
from thumper_tuning.report.export import write_models
from thumper_tuning.report.page import BoardResults, write_report
from thumper_tuning.report.text import (
    deciding_change,
    design_lines,
    is_better,
    tracking_change,
    tracking_lines,
)

T = TypeVar("T")
GAINS = {"before": "old", "after": "new"}
MotorText = Callable[[IdentifiedMotor], list[str]]


class ProcedureProgress(Protocol):
    """Where the procedure reports to, and where it computes."""

    def report_progress(self, done: int, total: int, activity: str, /) -> None:
        """Show how much of the activity is done; a total of 0 means unknown."""

    def report_line(self, line: str, /) -> None:
        """Show a line of the result."""

    def run_in_thread(self, work: Callable[[], T], /) -> T:
        """Compute a result that takes seconds."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What a tuning brought."""

    report: Path
    better: bool  # the new gains are worth saving
    change: str  # of the tracking error, by which that was decided


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class BoardProcedure:
    """The steps on one board; each reports its result."""

    board: Board
    folder: Path
    progress: ProcedureProgress
    motor_text: MotorText

    def identify(self, options: ExcitationOptions) -> list[IdentifiedMotor]:
        """Drive the identification experiment and identify the motors."""
        log = record(
            self.board, options, self.folder / "identification.csv", self._report_as("measuring the motors")
        )
        self.progress.report_progress(0, 0, "computing the motor models (takes up to a minute)")
        counts_per_rev = self.board.identity.counts_per_rev
        motors = self.progress.run_in_thread(
            lambda: [identify(logs) for logs in read_runs([log], counts_per_rev)]
        )
        for motor in motors:
            self._report_lines(self.motor_text(motor))
        return motors

    def tune(self, options: TuneOptions, old: BoardGains) -> Tuning:
        """Identify, design, drive with the old and the new gains.

        Writes gains.json, models.json and report.html. The board keeps the new gains, unsaved. Each drive
        after the first begins where the robot is now, so the procedure stays within the lanes of its options.
        """
        start_m = distance_m(self.board)
        motors = self.identify(options.excitation)
        self.progress.report_progress(0, 0, "computing the gains (takes up to a minute)")
        result = self.progress.run_in_thread(lambda: self._design(motors, options.design))
        self._report_lines(design_lines(result))
        write_gains_file(self.folder / "gains.json", result)
        self.progress.run_in_thread(lambda: write_models(self.folder, motors, result))
        before = self._verify("before", old, options.verify, start_m)
        after = self._verify("after", result.gains, options.verify, start_m)
        self.progress.report_progress(0, 0, "comparing the drives and writing the report")
        changes = zip(before.tracking, after.tracking, strict=True)
        self._report_lines([tracking_change(b, a) for b, a in changes])
        better = is_better(before, after, result)
        results = BoardResults(before=before, after=after, better=better)
        report = self.progress.run_in_thread(
            lambda: write_report(self.folder / "report.html", motors, result, results)
        )
        change = deciding_change(before, after, better=better)
        return Tuning(report=report, better=better, change=change)

    def _design(self, motors: list[IdentifiedMotor], options: DesignOptions) -> Design:
        period_s = 1.0 / self.board.identity.control_rate_Hz
        return design(*nominal_model(motors), dataclasses.replace(options, period_s=period_s))

    def _verify(self, name: str, gains: BoardGains, options: VerifyOptions, start_m: float) -> Verification:
        self.progress.report_progress(0, 0, "driving back to the start")
        return_to(self.board, start_m)
        self.progress.report_line(f"{name}:")
        path = self.folder / f"verify_{name}.csv"
        result = verify(
            self.board, gains, options, path, self._report_as(f"driving with the {GAINS[name]} gains")
        )
        self._report_lines(tracking_lines(result))
        return result

    def _report_as(self, title: str) -> Callable[[int, int, str], None]:
        return lambda done, total, activity: self.progress.report_progress(
            done, total, f"{title}: {activity}"
        )

    def _report_lines(self, lines: list[str]) -> None:
        for line in lines:
            self.progress.report_line(line)
