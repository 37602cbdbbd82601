"""`thumper tune` on a running robot: the page's experiments, started over the bus."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from thumper.runtime.service.experiments import ExperimentContext
from thumper_tuning.cli.procedure import BoardProcedure
from thumper_tuning.cli.settings import TuneOptions
from thumper_tuning.drive.board_gains import original_gains, write_gains
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.verify import VerifyOptions
from thumper_tuning.report.text import motor_summary

SPEEDS_RAD_S = (8.0, 6.0, 5.0, 4.0, 3.0)
HOLDS_S = (1.5, 0.5)
# How long the activities of `BoardProcedure.tune` take in turn, in simulation: record, compute the motor
# models, compute the gains, twice return to the start and verify, then compare the drives.
ACTIVITIES_S = (41, 8, 3, 5, 19, 1, 19, 6)


def identify_motors(context: ExperimentContext) -> Path | None:
    """Drive the identification experiment and report the motors' parameters."""
    _procedure(context).identify(ExcitationOptions(lane_m=context.lane_m))
    context.report_result("the motors are identified; the gains of the board are as before")
    return None


def tune_wheels(context: ExperimentContext) -> Path | None:
    """Run the whole procedure. The board uses the new gains, unsaved, if they are better.

    If they are not, and after an error, it has the old ones.
    """
    options = TuneOptions(excitation=ExcitationOptions(lane_m=context.lane_m), verify=_verification(context))
    whole = WholeProgress(context.report_progress)
    context = replace(context, report_progress=whole.report_progress)
    with original_gains(context.board) as old:
        tuning = _procedure(context).tune(options, old)
        if tuning.better:
            hint = "Under Gains, save them or revert to the saved ones."
            outcome = f"the board uses the new gains: {tuning.change}. {hint}"
        else:
            write_gains(context.board, old)
            outcome = f"kept the old gains: {tuning.change}"
    context.report_result(outcome)
    return tuning.report


class WholeProgress:
    """Turns the progress of each activity into that of the whole procedure, which never goes back."""

    def __init__(self, report: Callable[[int, int, str], None]) -> None:
        self._report = report
        self._number = -1  # of the present activity in `ACTIVITIES_S`
        self._title = ""

    def report_progress(self, done: int, total: int, activity: str) -> None:
        """Report how much of the whole procedure is done."""
        title = activity.partition(":")[0]
        if title != self._title:
            self._title = title
            self._number = min(self._number + 1, len(ACTIVITIES_S) - 1)
        share = done / total if total else 0.0
        done_s = sum(ACTIVITIES_S[: self._number]) + share * ACTIVITIES_S[self._number]
        self._report(round(10 * done_s), round(10 * sum(ACTIVITIES_S)), activity)


def _procedure(context: ExperimentContext) -> BoardProcedure:
    return BoardProcedure(
        board=context.board, folder=context.folder, progress=context, motor_text=motor_summary
    )


def _verification(context: ExperimentContext) -> VerifyOptions:
    """Return the fastest trapezoids that fit the lane."""
    radius_m = context.board.identity.wheel_radius_mm / 1000.0
    choices = [VerifyOptions(speed_rad_s=speed, hold_s=hold) for speed in SPEEDS_RAD_S for hold in HOLDS_S]
    return next((choice for choice in choices if choice.lane_m(radius_m) <= context.lane_m), choices[-1])
