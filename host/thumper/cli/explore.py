"""`thumper explore`: map an unknown place without being told where to go, and come back."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from thumper.navigation.frontiers import Explorer
    from thumper.navigation.goal import Goal
    from thumper.runtime import MissionResult, Runtime

HOME_TOLERANCE_M = 0.15


def explore(
    board: Annotated[str, typer.Option(help="Board port or URL; overrides the configuration.")] = "",
    lidar: Annotated[str, typer.Option(help="Lidar port or URL; overrides the configuration.")] = "",
    minutes: Annotated[float, typer.Option(help="Go home after this time [min].", min=0.1)] = 15.0,
    config: Annotated[Path | None, typer.Option(help="The robot's TOML; without it, a Wild Thumper.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for map, pictures and summary.")] = Path("out/explore"),
    record: Annotated[
        bool, typer.Option("--record", help="Record everything, in the folder that is configured.")
    ] = False,
    record_to: Annotated[Path | None, typer.Option(help="Record everything, in this folder.")] = None,
) -> None:
    """Drive to the borders of the known until there are none, return to the start, and leave the map.

    The robot starts at the map's origin and looks along x. Leaves with 1 when it did not come home.
    """
    from rich.console import Console

    from thumper.assembly import open_robot
    from thumper.bus.attach import on_bus_if_free
    from thumper.cli.output import prepare_output
    from thumper.cli.recorded import recorded
    from thumper.config.robot import load_config, with_ports
    from thumper.geometry import Pose2
    from thumper.navigation.frontiers import ExplorationOptions, Explorer
    from thumper.navigation.goal import Goal
    from thumper.report import write_run

    settings = with_ports(load_config(config), board=board, lidar=lidar)
    prepare_output(out)
    console = Console()
    home = Goal(x_m=0.0, y_m=0.0, tolerance_m=HOME_TOLERANCE_M)
    explorer = Explorer(ExplorationOptions(), settings.footprint)
    with (
        open_robot(settings, Pose2()) as robot,
        recorded(robot, settings, Pose2(), record, record_to),
        on_bus_if_free(robot, settings.name, settings.bus),
    ):
        ending = _explore(robot, explorer, 60.0 * minutes, console)
        console.print(ending)
        result = _drive(robot, home, "home", console)
        if result is None:
            raise typer.Exit(1)
        files = write_run(out, robot.mapper.grid(), robot.log, result)
    console.print(f"{'home' if result.reached else 'not home'}: {result.reason}")
    console.print(f"{', '.join(files)} are in {out}/")
    if not result.reached:
        raise typer.Exit(1)


def _explore(robot: "Runtime", explorer: "Explorer", limit_s: float, console: "Console") -> str:
    """Drive from frontier to frontier; returns why it ended, in words."""
    from thumper.geometry import Pose2

    # The first drive ends where it began: it makes the robot look round and gives the first map.
    from thumper.navigation.goal import Goal

    result = _drive(robot, Goal(x_m=0.0, y_m=0.0, tolerance_m=HOME_TOLERANCE_M), "look", console)
    pose, spent_s, count = Pose2() if result is None else result.map_from_base, 0.0, 0
    while spent_s < limit_s:
        goal = explorer.next_goal(robot.mapper.grid(), pose)
        if goal is None:
            return f"explored after {spent_s:.0f} s: no frontier is left ({count} were driven to)"
        count += 1
        result = _drive(robot, goal, f"frontier {count}", console)
        if result is not None:
            pose, spent_s = result.map_from_base, spent_s + result.time_s
            if not result.reached:
                console.print(f"frontier {count} at {goal} is left: {result.reason}")
    return f"time is up after {spent_s:.0f} s and {count} frontiers"


def _drive(robot: "Runtime", goal: "Goal", name: str, console: "Console") -> "MissionResult | None":
    """Drive there; None when the goal was refused before anything moved."""
    from thumper.cli.mission import drive_with_progress, raise_if_interrupted
    from thumper.errors import ThumperError

    try:
        result = drive_with_progress(robot, goal, name, console)
    except ThumperError as error:
        console.print(f"{name} at {goal} is left: {error}")
        return None
    raise_if_interrupted(result)
    return result
