"""`thumper run`: drive the robot to a goal, mapping on the way."""

import dataclasses
import math
from pathlib import Path
from typing import Annotated

import typer


def run(
    goal: Annotated[tuple[float, float], typer.Option(help="Where to drive: X Y in metres, in the map.")],
    board: Annotated[str, typer.Option(help="Board port or URL; overrides the configuration.")] = "",
    lidar: Annotated[str, typer.Option(help="Lidar port or URL; overrides the configuration.")] = "",
    start: Annotated[
        tuple[float, float, float],
        typer.Option(help="Where the robot stands: X Y in metres, then its heading in degrees."),
    ] = (0.0, 0.0, 0.0),
    tolerance: Annotated[float, typer.Option(help="How near is near enough, in metres.", min=0.02)] = 0.1,
    clear_fault: Annotated[bool, typer.Option(help="Clear a fault that the board has latched.")] = False,
    config: Annotated[Path | None, typer.Option(help="The robot's TOML; without it, a Wild Thumper.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for map, pictures and summary.")] = Path("out"),
) -> None:
    """Drive to a goal in a place that the robot has never seen, and leave the map behind.

    The map's frame is laid by --start: by default the robot stands at its origin and looks along x.
    """
    from rich.console import Console

    from thumper.assembly import open_robot
    from thumper.cli.mission import drive_with_progress
    from thumper.cli.output import prepare_output
    from thumper.config.robot import load_config
    from thumper.errors import ThumperError
    from thumper.geometry import Pose2
    from thumper.navigation.goal import Goal
    from thumper.report import write_run

    if not all(map(math.isfinite, (*goal, *start, tolerance))):
        raise ThumperError("--goal, --start and --tolerance take finite numbers", exit_code=2)
    settings = load_config(config)
    if board:
        settings = dataclasses.replace(settings, board=dataclasses.replace(settings.board, port=board))
    if lidar:
        settings = dataclasses.replace(settings, lidar=dataclasses.replace(settings.lidar, port=lidar))
    prepare_output(out)
    console = Console()
    start_pose = Pose2(x_m=start[0], y_m=start[1], theta_rad=math.radians(start[2]))
    target = Goal(x_m=goal[0], y_m=goal[1], tolerance_m=tolerance)
    with open_robot(settings, start_pose) as robot:
        result = drive_with_progress(robot, target, "driving", console, clear_fault=clear_fault)
        files = write_run(out, robot.mapper.grid(), robot.log, result)
    console.print(f"{result.path_length_m:.2f} m in {result.time_s:.1f} s; {', '.join(files)} are in {out}/")
    if not result.reached:
        raise ThumperError(f"goal not reached: {result.reason}", exit_code=130 if result.interrupted else 1)
    console.print(f"reached: {result.reason}")
