"""`thumper tune` on a running robot: the page's experiments, started over the bus."""

from pathlib import Path

from thumper.runtime.service.experiments import ExperimentContext
from thumper_tuning.cli.procedure import BoardProcedure
from thumper_tuning.cli.settings import TuneOptions
from thumper_tuning.drive.board_gains import original_gains
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.verify import VerifyOptions
from thumper_tuning.report.text import motor_summary

SPEEDS_RAD_S = (8.0, 6.0, 5.0, 4.0, 3.0)
HOLDS_S = (1.5, 0.5)


def identify_motors(context: ExperimentContext) -> Path | None:
    """Drive the identification experiment and report the motors' parameters."""
    _procedure(context).identify(ExcitationOptions(lane_m=context.lane_m))
    return None


def tune_wheels(context: ExperimentContext) -> Path | None:
    """Run the whole procedure. The board keeps the new gains unsaved; after an error, it has the old ones."""
    options = TuneOptions(excitation=ExcitationOptions(lane_m=context.lane_m), verify=_verification(context))
    with original_gains(context.board) as old:
        tuning = _procedure(context).tune(options, old)
    effect = "" if tuning.better else ", which are no better than the old ones"
    context.report_line(
        f"the board uses the new gains{effect}; under Gains, save them or revert to the saved ones"
    )
    return tuning.report


def _procedure(context: ExperimentContext) -> BoardProcedure:
    return BoardProcedure(
        board=context.board, folder=context.folder, progress=context, motor_text=motor_summary
    )


def _verification(context: ExperimentContext) -> VerifyOptions:
    """Return the fastest trapezoids that fit the lane."""
    radius_m = context.board.identity.wheel_radius_mm / 1000.0
    choices = [VerifyOptions(speed_rad_s=speed, hold_s=hold) for speed in SPEEDS_RAD_S for hold in HOLDS_S]
    return next((choice for choice in choices if choice.lane_m(radius_m) <= context.lane_m), choices[-1])
