"""The commands `thumper experiment` and `thumper calibrate`. They import libraries only when they run."""

from pathlib import Path
from typing import Annotated

import typer

from thumper.cli.options.common import ConfigFile

experiment = typer.Typer(
    help="Repeat the thesis's experiments and compare.\n\n"
    "Example: `thumper experiment speed --board /dev/ttyUSB0`",
    no_args_is_help=True,
)
calibrate = typer.Typer(
    help="Calibrate the robot's geometry and camera.\n\n"
    "Example: `thumper calibrate odometry --board /dev/ttyUSB0 --lidar /dev/ttyACM0`",
    no_args_is_help=True,
)

Board = Annotated[
    str, typer.Option(help="Serial port or URL of the board, as /dev/ttyUSB0 or sim://try/board?world=lab.")
]
Lidar = Annotated[
    str, typer.Option(help="Serial port or URL of the lidar; the map built on the drive is the reference.")
]
Log = Annotated[
    Path | None,
    typer.Option(help="Evaluate a CSV instead of driving: time_s, left_counts, right_counts."),
]
Truth = Annotated[
    Path | None, typer.Option(help="With --log: the true path, a CSV: time_s, x_m, y_m, theta_rad.")
]
Out = Annotated[Path, typer.Option(help="Folder for logs, figures and values.")]
Laps = Annotated[int, typer.Option(help="Number of laps of the course.", min=1, max=20)]
Yes = Annotated[bool, typer.Option("--yes", help="Skip the prompt: the floor is clear.")]


@experiment.command("odometry")
def experiment_odometry(
    board: Board = "/dev/ttyUSB0",
    lidar: Lidar = "",
    config: ConfigFile = None,
    log: Log = None,
    truth: Truth = None,
    out: Out = Path("out/experiment"),
    laps: Laps = 1,
    yes: Yes = False,
) -> None:
    """Experiment 8.1: wheel speeds from encoders and from a reference; mean and std beside the thesis's.

    The reference is the simulator's ground truth, a lidar's map, or a file.
    """
    _odometry(board, lidar, config, log, truth, out, laps, yes, calibrates=False)


@calibrate.command("odometry")
def calibrate_odometry(
    board: Board = "/dev/ttyUSB0",
    lidar: Lidar = "",
    config: ConfigFile = None,
    log: Log = None,
    truth: Truth = None,
    out: Out = Path("out/calibrate"),
    laps: Laps = 2,
    yes: Yes = False,
) -> None:
    """Fit wheel radii and effective track by least squares and write them as TOML.

    Prints the error before and after, on the half of the drive that was not fitted. The reference is that of
    `experiment odometry`.
    """
    _odometry(board, lidar, config, log, truth, out, laps, yes, calibrates=True)


@calibrate.command("camera")
def calibrate_camera(
    config: ConfigFile = None,
    images: Annotated[
        Path | None, typer.Option(help="Folder of images of the board, instead of the camera.")
    ] = None,
    columns: Annotated[int, typer.Option(help="Inner corners per row of the chessboard.", min=3)] = 9,
    rows: Annotated[int, typer.Option(help="Inner corners per column.", min=3)] = 6,
    square: Annotated[float, typer.Option(help="Edge of a square, in metres.", min=0.001)] = 0.025,
    views: Annotated[int, typer.Option(help="Number of different views.", min=8, max=100)] = 20,
    out: Out = Path("out/calibrate"),
) -> None:
    """Fit the camera's intrinsics to views of a printed chessboard and write them as TOML.

    Hold the board in front of the camera: whole in view, tilted, near and far, at all edges of the image.

    Example: `thumper calibrate camera --config robot.toml --square 0.024`
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.common.optional_packages import require_extra
    from thumper.config.robot import load_config

    require_extra("camera")
    from thumper_tuning.calibration import camera  # needs OpenCV

    settings = load_config(config).camera
    prepare_output(out)
    board = camera.Chessboard(columns=columns, rows=rows, square_m=square)
    frames = camera.frames_of(settings) if images is None else camera.images_of(images)
    found = camera.calibrate(frames, board, views=views)
    (out / "camera.toml").write_text(found.toml(), encoding="utf-8")
    print(found.toml(), end="")
    print(
        f"# {found.rms_px:.2f} pixels rms, focal length +-{found.focal_std_px:.1f} pixels; {out}/camera.toml"
    )


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

    from thumper.cli.output.folder import new_output
    from thumper.config.robot import check_same_robot, load_config
    from thumper_tuning.calibration import odometry
    from thumper_tuning.calibration.course import CourseOptions

    check_same_robot(board, lidar)
    console, robot = Console(), load_config(config)
    source = odometry.DriveSource(
        board=board, lidar=lidar, lidar_model=robot.lidar.model, log=log, truth=truth
    )
    course = CourseOptions(laps=laps)
    evaluate = odometry.calibrate_odometry if calibrates else odometry.run_odometry_experiment
    with new_output(out):
        wheels = odometry.collect_drive(source, robot, course, out, yes=yes, console=console)
        evaluate(wheels, robot, out, console)


@experiment.command("speed")
def experiment_speed(
    board: Board = "/dev/ttyUSB0",
    baud: Annotated[int, typer.Option(help="Baud rate of the board's firmware.", min=1)] = 500_000,
    out: Out = Path("out/experiment"),
    hold: Annotated[float, typer.Option(help="How long to hold 8 rad/s, in seconds.", min=0.0)] = 8.0,
    yes: Yes = False,
) -> None:
    """Experiment 8.2: drive straight with the board's gains; set-point minus measured speed.

    Prints the error, the thesis's error, and the error due to counting alone.
    """
    from rich.console import Console

    from thumper.cli.output.folder import new_output
    from thumper_tuning.calibration.speed_tracking import run_speed_experiment
    from thumper_tuning.drive.console import open_board
    from thumper_tuning.drive.verify import VerifyOptions

    with new_output(out), open_board(board, baud) as robot:
        run_speed_experiment(robot, VerifyOptions(hold_s=hold), out, Console(), yes=yes)
