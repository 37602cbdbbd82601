"""The commands of `thumper tune`. Heavy imports wait until a command runs."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    help="Identify the motors and tune the wheels' speed control: all steps, or one at a time.",
    invoke_without_command=True,
)

# One line a paragraph: the help breaks them itself.
FIT_HELP = (
    "Identify motors from logs: gain, time constant, static friction, delay, each with its uncertainty.\n\n"
    "A log is a CSV file with a header. Columns: time_s (or time_ms, time_us); pwm (of 255) or voltage_V, "
    "forward positive; counts (of the encoder, running on) or speed_rad_s (or speed_rpm, speed_counts_s). "
    "For several wheels: left_pwm, left_counts, right_pwm and so on. Optional: battery_V, current_A.\n\n"
    "A row holds the counts at its time and the drive applied from then until the next row. Rows may come "
    "irregularly, be missing, or hold glitches. Several files are runs of the same motor. SysId's JSON is "
    "read as well.\n\n"
    "With --json: per motor gain_rad_s_per_pwm (or _per_V), time_constant_s, static_friction_pwm (or _V) and "
    "delay_s, each with its _std, fit_percent on held-out data, and warnings; for several motors one object "
    "each."
)

Board = Annotated[
    str, typer.Option(help="Board port or URL, for example /dev/ttyUSB0 or sim://tune/board?world=hall.")
]
Out = Annotated[Path, typer.Option(help="Folder for logs, gains and report.")]
Files = Annotated[list[Path], typer.Argument(help="Logs of one robot or motor.")]
CountsPerRev = Annotated[float, typer.Option(help="Encoder counts a turn of the wheel.", min=1.0)]
Settings = Annotated[
    Path | None,
    typer.Option(help="TOML with tables [excitation], [verify], [design]; options given here come first."),
]
Lane = Annotated[
    float | None,
    typer.Option(
        help="Free floor ahead of the robot, and as much behind it, in metres.", min=0.6, show_default="1.2"
    ),
]
Hold = Annotated[
    float | None,
    typer.Option(help="How long verification holds its top speed, in seconds.", min=0.0, show_default="1.5"),
]
Yes = Annotated[bool, typer.Option("--yes", help="Ask nothing: the lane is free, and the gains are saved.")]
LaneFree = Annotated[bool, typer.Option("--yes", help="Ask nothing: the lane is free.")]
OneDirection = Annotated[bool, typer.Option("--one-direction", help="Accept a log that drives one way only.")]
Rule = Annotated[
    str | None,
    typer.Option(
        help="migo, improved-simc, simc, amigo, ziegler-nichols or pole-placement.", show_default="migo"
    ),
]
Sensitivity = Annotated[
    float | None,
    typer.Option(help="Largest Ms for migo: 1.4 is safe, 2 is brisk.", min=1.05, max=3.0, show_default="1.6"),
]
Manual = Annotated[
    tuple[float, float] | None, typer.Option(help="KP KI of your own instead of a rule: judged, not changed.")
]
Rate = Annotated[int, typer.Option(help="The firmware's control rate in Hz.", min=1, max=255)]
Battery = Annotated[
    float | None,
    typer.Option(help="Battery voltage during the log, in volts; else its battery_V column, else 7.4."),
]


@app.callback()
def tune(
    context: typer.Context,
    board: Board = "/dev/ttyUSB0",
    out: Out = Path("out/tune"),
    lane: Lane = None,
    hold: Hold = None,
    rule: Rule = None,
    ms: Sensitivity = None,
    settings: Settings = None,
    yes: Yes = False,
) -> None:
    """Record, fit, design, verify and report in one go; the gains are written when you confirm."""
    if context.invoked_subcommand is not None:
        return
    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import tune_all

    wanted = load_settings(settings).but(lane_m=lane, hold_s=hold, rule=rule, largest_sensitivity=ms)
    tune_all(
        board,
        prepare_output(out),
        wanted.excitation,
        wanted.verify,
        wanted.design,
        yes=yes,
        console=Console(),
    )


@app.command()
def record(
    board: Board = "/dev/ttyUSB0",
    out: Out = Path("out/tune"),
    lane: Lane = None,
    settings: Settings = None,
    yes: LaneFree = False,
) -> None:
    """Drive the identification experiment to and fro, leave identification.csv. Ctrl-C stops the motors."""
    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import LANE_WIDTH_M, confirm_room, opened, record_to

    console = Console()
    options = load_settings(settings).but(lane_m=lane).excitation
    prepare_output(out)
    with opened(board) as robot:
        room = f"a lane {LANE_WIDTH_M:g} m wide, {options.lane_m:g} m ahead and as much behind"
        confirm_room(room, console, yes=yes)
        path = record_to(robot, out / "identification.csv", options, console)
    console.print(f"{path} is there; next: thumper tune fit {path}")


@app.command(help=FIT_HELP)
def fit(
    files: Files,
    json: Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")] = False,
    counts_per_rev: CountsPerRev = 1200.0,
    one_direction: OneDirection = False,
    variants: Annotated[
        bool, typer.Option("--variants", help="Try a second pole, and play before a mass, as well.")
    ] = False,
    resistance: Annotated[
        float | None, typer.Option(help="Winding resistance in ohm, for the physical constants.", min=0.001)
    ] = None,
) -> None:
    """Identify motors from logs."""
    from thumper_tuning.cli.fit import fit_files

    fit_files(
        files,
        counts_per_rev=counts_per_rev,
        one_direction=one_direction,
        as_json=json,
        variants=variants,
        resistance_Ohm=resistance,
    )


@app.command()
def design(
    files: Files,
    out: Out = Path("out/tune"),
    rule: Rule = None,
    ms: Sensitivity = None,
    manual: Manual = None,
    rate: Rate = 10,
    battery: Battery = None,
    counts_per_rev: CountsPerRev = 1200.0,
    one_direction: OneDirection = False,
    settings: Settings = None,
) -> None:
    """Design gains for logged motors, on the wire's grid, and leave gains.json and report.html."""
    from dataclasses import replace

    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import design_for, identify_files, write_gains_file
    from thumper_tuning.design.tuning_rules import PiGains
    from thumper_tuning.report.page import write_report

    console = Console()
    wanted = load_settings(settings).but(rule=rule, largest_sensitivity=ms)
    options = replace(wanted.design, period_s=1.0 / rate)
    if manual:
        options = replace(options, manual=PiGains(kp=manual[0], ki=manual[1]))
    prepare_output(out)
    motors = identify_files(files, counts_per_rev, one_direction)
    result = design_for(motors, options, battery, console)
    path = write_gains_file(out / "gains.json", result)
    page = write_report(out / "report.html", motors, result)
    console.print(f"{path} and {page} are there; next: thumper tune verify {path} --board PORT")


@app.command()
def verify(
    gains: Annotated[Path, typer.Argument(help="gains.json of `tune design`.")],
    board: Board = "/dev/ttyUSB0",
    out: Out = Path("out/tune"),
    hold: Hold = None,
    settings: Settings = None,
    yes: LaneFree = False,
) -> None:
    """Set the gains, drive trapezoids there and back, and print how well the set-point was followed."""
    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper_tuning.cli.settings import load_settings
    from thumper_tuning.cli.steps import LANE_WIDTH_M, confirm_room, opened, read_gains_file, verify_on

    console = Console()
    options = load_settings(settings).but(hold_s=hold).verify
    wanted = read_gains_file(gains)
    prepare_output(out)
    with opened(board) as robot:
        lane_m = options.lane_m(robot.identity.wheel_radius_mm / 1000.0)
        confirm_room(f"a lane {LANE_WIDTH_M:g} m wide, {lane_m:.1f} m ahead", console, yes=yes)
        verify_on(robot, wanted, options, out / "verify.csv", console)


@app.command()
def report(
    files: Files,
    out: Out = Path("out/tune"),
    rule: Rule = None,
    ms: Sensitivity = None,
    rate: Rate = 10,
    battery: Battery = None,
    counts_per_rev: CountsPerRev = 1200.0,
    one_direction: OneDirection = False,
    settings: Settings = None,
) -> None:
    """Write report.html for logs: data, model, residuals, Bode, Nyquist, step, sensitivity, pole-zero map."""
    design(
        files, out=out, rule=rule, ms=ms, manual=None, rate=rate, battery=battery,
        counts_per_rev=counts_per_rev, one_direction=one_direction, settings=settings,
    )  # fmt: skip
