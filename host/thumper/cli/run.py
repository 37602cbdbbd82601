"""`thumper run`: start the robot; with goals drive to them and end, without keep it at others' service."""

import math
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.interrupted import interrupt_told

if TYPE_CHECKING:
    from rich.console import Console

    from thumper.config.robot import RobotConfig
    from thumper.runtime.loop import RobotLoop


@interrupt_told()
def run(
    goal: Annotated[
        tuple[float, float] | None,
        typer.Option("--goal", "--goto", help="Where to drive: X Y in metres, in the map."),
    ] = None,
    heading: Annotated[
        float | None, typer.Option(help="Which way to look at --goal, in degrees from x.")
    ] = None,
    waypoint: Annotated[
        list[str] | None,
        typer.Option(help="X,Y in metres; may be given often: driven to in that order, before --goal."),
    ] = None,
    patrol: Annotated[
        int, typer.Option(help="Drive all waypoints (and the goal) this often.", min=1, max=10_000)
    ] = 1,
    board: Annotated[str, typer.Option(help="Board port or URL; overrides the configuration.")] = "",
    lidar: Annotated[str, typer.Option(help="Lidar port or URL; overrides the configuration.")] = "",
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            help="Where the robot stands: X Y in metres, then its heading in degrees. Without it the origin, "
            "or with --map or --session wherever it recognises."
        ),
    ] = None,
    saved_map: Annotated[
        Path | None, typer.Option("--map", help="Localise in this map (its .yaml) instead of mapping.")
    ] = None,
    session: Annotated[
        Path | None, typer.Option(help="Go on mapping in this map.session, from another run or `map-log`.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="How near is near enough, in metres.", min=0.02, max=1.0)
    ] = 0.1,
    clear_fault: Annotated[bool, typer.Option(help="Clear a fault that the board has latched.")] = False,
    config: Annotated[Path | None, typer.Option(help="The robot's TOML; without it, a Wild Thumper.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for map, pictures and summary.")] = Path("out/run"),
    speed: Annotated[
        float,
        typer.Option(help="Pace of a simulated robot that is at service; 1 is real time.", min=0.1, max=20.0),
    ] = 1.0,
    bus: Annotated[str, typer.Option(help="HOST:PORT of the bus; overrides the configuration.")] = "",
    ui: Annotated[
        bool, typer.Option("--ui", help="Serve the page in the browser beside it; see `thumper dashboard`.")
    ] = False,
    record: Annotated[
        bool, typer.Option("--record", help="Record everything, in the folder that is configured.")
    ] = False,
    record_to: Annotated[Path | None, typer.Option(help="Record everything, in this folder.")] = None,
) -> None:
    """Drive to a goal, or round waypoints, in a place that the robot has never seen; leave the map behind.

    The map's frame is laid by --start: by default the robot stands at its origin and looks along x.
    In a --map or a --session that frame holds, and the robot first finds out where in it it stands.
    Without a goal the robot stays at service until Ctrl-C: it maps, and does what `thumper goto`, a page, a
    gamepad or another program asks of it over the bus.
    """
    from rich.console import Console

    from thumper.bus.serve_robot import on_bus_if_free
    from thumper.cli.drive_progress import drive_with_progress, print_notes
    from thumper.cli.output_folder import prepare_output
    from thumper.cli.record_option import recorded
    from thumper.cli.run_report import write_run
    from thumper.cli.start_map import known_place
    from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE, ThumperError
    from thumper.common.geometry import Pose2
    from thumper.config.robot import load_config, with_ports
    from thumper.dashboard.process import beside
    from thumper.navigation.goal import Goal, check_place
    from thumper.runtime.assembly import open_robot
    from thumper.runtime.drive.waypoints import Itinerary, follow

    places = [*map(_place, waypoint or []), *([goal] if goal else [])]
    if not all(map(math.isfinite, (*chain(*places), *(start or ()), tolerance, heading or 0.0))):
        raise ThumperError(
            "--goal, --heading, --waypoint and --start take finite numbers", exit_code=EXIT_USAGE
        )
    for place in places:
        check_place("the goal", *place)
    if start is not None:
        check_place("--start", *start[:2])
    if heading is not None and goal is None:
        raise ThumperError("--heading belongs to --goal X Y", exit_code=EXIT_USAGE)
    if patrol > 1 and not places:
        raise ThumperError("--patrol belongs to --waypoint X,Y or --goal X Y", exit_code=EXIT_USAGE)
    settings = with_ports(load_config(config), board=board, lidar=lidar)
    if bus:
        settings = replace(settings, bus=settings.bus.at(bus))
    prepare_output(out)
    console = Console()
    start_pose = Pose2(x_m=start[0], y_m=start[1], theta_rad=math.radians(start[2])) if start else None
    known = known_place(settings, saved_map, session)
    goals = tuple(Goal(x_m=x_m, y_m=y_m, tolerance_m=tolerance) for x_m, y_m in places)
    if heading is not None:
        goals = (*goals[:-1], replace(goals[-1], theta_rad=math.radians(heading)))
    if not goals:
        with (
            beside(config, settings.bus.address, wanted=ui),
            open_robot(settings, start_pose, known) as robot,
            recorded(robot, settings, start_pose or Pose2(), record, record_to),
        ):
            _serve(robot, settings, speed, out, console)
        return
    with (
        beside(config, settings.bus.address, wanted=ui),
        open_robot(settings, start_pose, known) as robot,
        recorded(robot, settings, start_pose or Pose2(), record, record_to),
        on_bus_if_free(robot, settings.name, settings.bus),
    ):
        result = follow(
            Itinerary(goals=goals, rounds=patrol),
            lambda name, leg: drive_with_progress(robot, leg, name, console, clear_fault=clear_fault),
        )
        files = write_run(out, robot.mapper, robot.log, result)
        print_notes(robot, console)
    left = f"{result.path_length_m:.2f} m in {result.time_s:.1f} s; {', '.join(files)} are in {out}/"
    console.print(left, soft_wrap=True)
    if not result.reached:
        raise ThumperError(
            f"goal not reached: {result.reason}", exit_code=EXIT_INTERRUPTED if result.interrupted else 1
        )
    console.print(f"reached: {result.reason}")


def _serve(robot: "RobotLoop", settings: "RobotConfig", speed: float, out: Path, console: "Console") -> None:
    from thumper.bus.serve_robot import on_bus
    from thumper.cli.drive_progress import print_notes
    from thumper.runtime.requests import LogMessage
    from thumper.runtime.service.map_saver import MapSaver
    from thumper.slam.saved_state import SavedSlamState

    def tell(text: str, good: bool) -> None:
        robot.inbox.put(LogMessage(text=text, good=good))

    def session() -> SavedSlamState:
        situation = robot.senses.perception.situation()
        pose = situation.map_from_base if situation and not situation.lost else None
        return SavedSlamState(counts=robot.mapper.counts(), map_from_base=pose)

    robot.desk.handlers["save_map"] = MapSaver(robot.mapper.grid, session, out / "map.yaml", tell)
    with on_bus(robot, settings.name, settings.bus):
        console.print(f"{settings.name} is at service on {settings.bus.address}; Ctrl-C ends it")
        robot.serve(speed=speed)
        print_notes(robot, console)
    console.print("stopped")


def _place(text: str) -> tuple[float, float]:
    from thumper.common.errors import EXIT_USAGE, ThumperError

    try:
        x_m, y_m = map(float, text.split(","))
    except ValueError as error:
        raise ThumperError(
            f"--waypoint {text}: give X,Y in metres, as in --waypoint 1.0,-0.5", exit_code=EXIT_USAGE
        ) from error
    return x_m, y_m
