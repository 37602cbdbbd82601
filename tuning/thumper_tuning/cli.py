"""The commands of `thumper tune`. Heavy imports wait until a command runs."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Identify the motors and tune the wheels' speed control.", no_args_is_help=True)

FIT_HELP = """Identify a motor from a log: gain, time constant, static friction and delay, each with
its uncertainty.

A CSV file with a header. Columns: time_s (or time_ms, time_us); pwm (of 255) or voltage_V, forward
positive; counts
(of the encoder, running on) or speed_rad_s (or speed_rpm, ...). For several wheels: left_pwm,
left_counts, right_pwm
... Optional: battery_V, current_A. A row holds the counts at its time and the drive applied from then
until the next
row. Several files are runs of the same motor. SysId's JSON is read as well.
"""


@app.callback()
def _tune() -> None:
    pass


@app.command(help=FIT_HELP)
def fit(
    files: Annotated[list[Path], typer.Argument(help="Logs of one robot or motor.")],
    json: Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")] = False,
    counts_per_rev: Annotated[
        float, typer.Option(help="Encoder counts a turn of the wheel.", min=1.0)
    ] = 1200.0,
    one_direction: Annotated[
        bool, typer.Option("--one-direction", help="Accept a log that drives one way only.")
    ] = False,
) -> None:
    """Identify motors from logs."""
    from thumper_tuning.fit_command import fit_files

    fit_files(files, counts_per_rev=counts_per_rev, one_direction=one_direction, as_json=json)
