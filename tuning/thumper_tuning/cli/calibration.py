"""The commands `thumper experiment` and `thumper calibrate`. Heavy imports wait until a command runs."""

from pathlib import Path
from typing import Annotated

import typer

experiment = typer.Typer(help="Repeat the thesis's experiments, and compare.", no_args_is_help=True)
calibrate = typer.Typer(help="Measure the robot's geometry.", no_args_is_help=True)

Board = Annotated[
    str, typer.Option(help="Board port or URL, for example /dev/ttyUSB0 or sim://try/board?world=lab.")
]
Lidar = Annotated[
    str, typer.Option(help="Lidar port or URL: the map built on the way tells where the robot was.")
]
Config = Annotated[Path | None, typer.Option(help="The robot's TOML; the Wild Thumper's values without it.")]
Log = Annotated[
    Path | None, typer.Option(help="Drive nothing, read a CSV: time_s, left_counts, right_counts.")
]
Truth = Annotated[
    Path | None, typer.Option(help="With --log: where the robot was, a CSV: time_s, x_m, y_m, theta_rad.")
]
Out = Annotated[Path, typer.Option(help="Folder for logs, figures and values.")]
Laps = Annotated[int, typer.Option(help="How often to drive the course.", min=1, max=20)]
Yes = Annotated[bool, typer.Option("--yes", help="Ask nothing: the floor is free.")]


@calibrate.callback()
def _calibrate() -> None:
    """Measure the robot's geometry."""  # without a callback typer makes a lone command the whole program


@experiment.command("odometry")
def experiment_odometry(
    board: Board = "/dev/ttyUSB0",
    lidar: Lidar = "",
    config: Config = None,
    log: Log = None,
    truth: Truth = None,
    out: Out = Path("out/experiment"),
    laps: Laps = 1,
    yes: Yes = False,
) -> None:
    """Experiment 8.1: wheel speeds by the encoders against those of a reference; mean and std beside the
    thesis's. The reference is the simulator's truth, a lidar's map, or a file."""
    _odometry(board, lidar, config, log, truth, out, laps, yes, calibrates=False)


@calibrate.command("odometry")
def calibrate_odometry(
    board: Board = "/dev/ttyUSB0",
    lidar: Lidar = "",
    config: Config = None,
    log: Log = None,
    truth: Truth = None,
    out: Out = Path("out/calibrate"),
    laps: Laps = 2,
    yes: Yes = False,
) -> None:
    """Fit wheel radii and effective track by least squares, write them as TOML, and print the error before
    and after on the half of the drive that was not fitted. The reference as for `experiment odometry`."""
    _odometry(board, lidar, config, log, truth, out, laps, yes, calibrates=True)


def _odometry(
    board: str,
    lidar: str,
    config: Path | None,
    log: Path | None,
    truth: Path | None,
    out: Path,
    laps: int,
    yes: bool,
    *,
    calibrates: bool,
) -> None:
    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper.config.robot import check_same_robot, load_config
    from thumper_tuning.calibration import odometry
    from thumper_tuning.calibration.course import CourseOptions

    check_same_robot(board, lidar)
    console, robot = Console(), load_config(config)
    prepare_output(out)
    source = odometry.Source(board=board, lidar=lidar, lidar_model=robot.lidar.model, log=log, truth=truth)
    wheels = odometry.gather(source, robot, CourseOptions(laps=laps), out, yes=yes, console=console)
    (odometry.calibration if calibrates else odometry.experiment)(wheels, robot, out, console)


@experiment.command("speed")
def experiment_speed(
    board: Board = "/dev/ttyUSB0",
    out: Out = Path("out/experiment"),
    hold: Annotated[float, typer.Option(help="How long to hold 8 rad/s, in seconds.", min=0.0)] = 8.0,
    yes: Yes = False,
) -> None:
    """Experiment 8.2: drive straight with the board's gains; set-point minus measured speed beside the
    thesis's, and how far that is above what counting leaves."""
    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper_tuning.calibration import speed_tracking
    from thumper_tuning.cli.steps import opened
    from thumper_tuning.drive.verify import VerifyOptions

    prepare_output(out)
    with opened(board) as robot:
        speed_tracking.run(robot, VerifyOptions(hold_s=hold), out, Console(), yes=yes)
