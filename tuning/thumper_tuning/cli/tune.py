"""The commands of `thumper tune`. They import numerical libraries only when they run."""

from pathlib import Path
from typing import Annotated

import typer

from thumper.cli.options.common import AsJson, BusAddress, ConfigFile, RobotName

app = typer.Typer(
    help="Identify the motors and tune the wheel-speed control: all steps, or one at a time.\n\n"
    "Examples:\n\n- `thumper tune --board /dev/ttyUSB0`\n- `thumper tune fit LOG.csv`",
    invoke_without_command=True,
)

# One line per paragraph: the terminal wraps it.
FIT_HELP = (
    "Identify motors from logs: gain, time constant, static friction, delay, each with its uncertainty.\n\n"
    "A log is a CSV file with a header. Columns: time_s (or time_ms, time_us); pwm (of 255) or voltage_V, "
    "forward positive; counts (of the encoder, cumulative) or speed_rad_s (or speed_rpm, speed_counts_s). "
    "For several wheels: left_pwm, left_counts, right_pwm and so on. Optional: battery_V, current_A.\n\n"
    "A row holds the counts at its time and the drive applied from then until the next row. Rows may be "
    "irregular or missing, and may contain glitches. Several files are runs of the same motor. SysId "
    "(.json), MATLAB (.mat) and MCAP files of Thumper and ROS 2 work as well.\n\n"
    "With --json, each motor has gain_rad_s_per_pwm (or _per_V), time_constant_s, static_friction_pwm (or "
    "_V) and delay_s, each with its _std, fit_percent on held-out data, and warnings. Several motors give "
    "one object each."
)

Board = Annotated[
    str, typer.Option(help="Serial port or URL of the board, as /dev/ttyUSB0 or sim://?world=hall.")
]
Baud = Annotated[int, typer.Option(help="Baud rate of the board's firmware.", min=1)]
Out = Annotated[Path, typer.Option(help="Folder for logs, gains and report.")]
Files = Annotated[list[Path], typer.Argument(help="Logs of one robot or motor.")]
DesignFiles = Annotated[
    list[Path] | None,
    typer.Argument(help="Logs of one robot or motor; none: the running robot.", show_default=False),
]
CountsPerRev = Annotated[float, typer.Option(help="Encoder counts per wheel revolution.", min=1.0)]
Settings = Annotated[
    Path | None,
    typer.Option(
        help="TOML file with the tables [excitation], [verify], [design]; command-line options override it."
    ),
]
Lane = Annotated[
    float | None,
    typer.Option(
        help="Free floor for the identification, ahead and as much behind, in metres; verification asks "
        "for more ahead.",
        min=0.6,
        show_default="1.2",
    ),
]
Hold = Annotated[
    float | None,
    typer.Option(help="How long verification holds its top speed, in seconds.", min=0.0, show_default="1.5"),
]
Yes = Annotated[
    bool,
    typer.Option("--yes", help="Skip the prompts: the lane is clear; save the new gains if they are better."),
]
LaneClear = Annotated[bool, typer.Option("--yes", help="Skip the prompt: the lane is clear.")]
Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--column",
        help="Use a column as time, drive, output, battery or current, for example drive=MotorPWM, "
        "time=Timestamp:ms or output=3:rpm (a number counts from 1). Repeat it for each column.",
        show_default=False,
    ),
]


def _rules() -> list[str]:
    from thumper_tuning.design.gains import RULE_NAMES  # slow

    return list(RULE_NAMES)


Rule = Annotated[
    str | None,
    typer.Option(
        help="migo, migo-1.4, improved-simc, simc, amigo, ziegler-nichols, pole-placement or dlqr.",
        show_default="migo",
        autocompletion=_rules,
    ),
]
Sensitivity = Annotated[
    float | None,
    typer.Option(
        help="Maximum sensitivity Ms for migo and dlqr: 1.4 is safe, 2 is brisk.",
        min=1.05,
        max=3.0,
        show_default="1.6",
    ),
]
Manual = Annotated[
    tuple[float, float] | None,
    typer.Option(help="Use your own KP KI instead of a rule: evaluated, not changed."),
]
Rate = Annotated[int, typer.Option(help="The firmware's control rate in Hz.", min=1, max=255)]
Battery = Annotated[
    float | None,
    typer.Option(help="Battery voltage during the log, in volts; default: its battery_V column, else 7.4."),
]


@app.callback()
def tune(
    context: typer.Context,
    board: Board = "/dev/ttyUSB0",
    baud: Baud = 500_000,
    out: Out = Path("out/tune"),
    lane: Lane = None,
    hold: Hold = None,
    rule: Rule = None,
    ms: Sensitivity = None,
    settings: Settings = None,
    yes: Yes = False,
) -> None:
    """Record, fit, design, verify and report in one run; save the gains after you confirm."""
    if context.invoked_subcommand is not None:
        return
    from rich.console import Console

    from thumper.cli.output.folder import new_output
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import tune_robot

    options = load_settings(settings).override(lane_m=lane, hold_s=hold, rule=rule, largest_sensitivity=ms)
    with new_output(out):
        tune_robot(board, baud, out, options, yes=yes, console=Console())


@app.command()
def record(
    board: Board = "/dev/ttyUSB0",
    baud: Baud = 500_000,
    out: Out = Path("out/tune"),
    lane: Lane = None,
    settings: Settings = None,
    yes: LaneClear = False,
) -> None:
    """Drive the identification experiment back and forth and write identification.csv. Ctrl-C stops it."""
    from rich.console import Console

    from thumper.cli.output.folder import new_output
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import record_on

    options = load_settings(settings).override(lane_m=lane)
    with new_output(out):
        record_on(board, baud, out, options.excitation, yes=yes, console=Console())


@app.command(help=FIT_HELP)
def fit(
    files: Files,
    json: AsJson = False,
    counts_per_rev: CountsPerRev = 1200.0,
    column: Columns = None,
    variants: Annotated[
        bool,
        typer.Option("--variants", help="Compare with second-order, backlash and ERA models (takes 20 s)."),
    ] = False,
    resistance: Annotated[
        float | None, typer.Option(help="Winding resistance in ohm, for the physical constants.", min=0.001)
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(help="Folder for models.json and load_models.py: the models for python-control."),
    ] = None,
) -> None:
    """Identify motors from logs."""
    from thumper.cli.output.folder import prepare_output
    from thumper_tuning.cli.fit import fit_files
    from thumper_tuning.logs.roles import parse_choices

    fit_files(
        files,
        counts_per_rev=counts_per_rev,
        as_json=json,
        choices=parse_choices(column),
        variants=variants,
        resistance_Ohm=resistance,
        export=prepare_output(export, "--export") if export is not None else None,
    )


@app.command()
def design(
    files: DesignFiles = None,
    out: Out = Path("out/tune"),
    rule: Rule = None,
    ms: Sensitivity = None,
    manual: Manual = None,
    rate: Rate = 10,
    battery: Battery = None,
    counts_per_rev: CountsPerRev = 1200.0,
    column: Columns = None,
    settings: Settings = None,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Design gains for logged motors, in the board's fixed point; write gains.json and report.html.

    Without logs, for the wheels of a running robot, as it estimates them while it drives: gains.json only.
    """
    from dataclasses import replace

    from rich.console import Console

    from thumper.cli.output.folder import prepare_output
    from thumper_tuning.cli.fit import identify_files
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import design_from_motors
    from thumper_tuning.design.tuning_rules import PiGains
    from thumper_tuning.logs.roles import parse_choices

    options = replace(
        load_settings(settings).override(rule=rule, largest_sensitivity=ms).design, period_s=1.0 / rate
    )
    if manual:
        options = replace(options, manual=PiGains(kp=manual[0], ki=manual[1]))
    prepare_output(out)
    if not files:
        from thumper_tuning.cli.running_robot import design_from_estimate, wheels_state

        design_from_estimate(wheels_state(config, bus, robot), out, options, Console())
        return
    motors = identify_files(files, counts_per_rev, parse_choices(column))
    design_from_motors(motors, out, options, battery, Console())


@app.command()
def verify(
    gains: Annotated[Path, typer.Argument(help="gains.json of `tune design`.")],
    board: Board = "/dev/ttyUSB0",
    baud: Baud = 500_000,
    out: Out = Path("out/tune"),
    hold: Hold = None,
    settings: Settings = None,
    yes: LaneClear = False,
) -> None:
    """Set the gains, drive trapezoids forward and backward, and print the tracking error."""
    from rich.console import Console

    from thumper.cli.output.folder import new_output
    from thumper_tuning.cli.gains_file import read_gains_file
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import verify_on

    options = load_settings(settings).override(hold_s=hold)
    new_gains = read_gains_file(gains)
    with new_output(out):
        verify_on(board, baud, new_gains, out, options.verify, yes=yes, console=Console())


@app.command()
def report(
    files: Files,
    out: Out = Path("out/tune"),
    rule: Rule = None,
    ms: Sensitivity = None,
    rate: Rate = 10,
    battery: Battery = None,
    counts_per_rev: CountsPerRev = 1200.0,
    column: Columns = None,
    settings: Settings = None,
) -> None:
    """Write report.html for logs: data, model, residuals, Bode, Nyquist, step, sensitivity, pole-zero map."""
    design(
        files,
        out=out,
        rule=rule,
        ms=ms,
        manual=None,
        rate=rate,
        battery=battery,
        counts_per_rev=counts_per_rev,
        column=column,
        settings=settings,
    )
