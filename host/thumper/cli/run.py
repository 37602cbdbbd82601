"""`thumper run`: start the robot; drive to the given goals and exit, or run until Ctrl-C."""

import math
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.common_options import (
    BoardPort,
    BusAddress,
    ClearFault,
    ConfigFile,
    GoalTolerance,
    LidarPort,
    Record,
    RecordTo,
    RunFolder,
    SavedMap,
    Session,
    StartPose,
)
from thumper.cli.interrupted import report_interrupt

if TYPE_CHECKING:
    from rich.console import Console

    from thumper.config.robot import RobotConfig
    from thumper.runtime.loop import RobotLoop


@report_interrupt()
def run(
    goal: Annotated[
        tuple[float, float] | None,
        typer.Option("--goal", metavar="X Y", help="Goal in the map, in metres."),
    ] = None,
    heading: Annotated[
        float | None, typer.Option(help="Heading at --goal, in degrees from the x axis.")
    ] = None,
    waypoint: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="Waypoint before --goal, in metres; repeat for more."),
    ] = None,
    patrol: Annotated[
        int, typer.Option(help="Number of rounds over the waypoints and the goal.", min=1, max=10_000)
    ] = 1,
    board: BoardPort = "",
    lidar: LidarPort = "",
    start: StartPose = None,
    saved_map: SavedMap = None,
    session: Session = None,
    tolerance: GoalTolerance = 0.1,
    clear_fault: ClearFault = False,
    config: ConfigFile = None,
    out: RunFolder = Path("out/run"),
    speed: Annotated[
        float,
        typer.Option(
            help="Real-time factor of a simulated robot that runs without a goal.", min=0.1, max=20.0
        ),
    ] = 1.0,
    bus: BusAddress = "",
    ui: Annotated[
        bool, typer.Option("--ui", help="Also serve the browser page; see `thumper dashboard`.")
    ] = False,
    record: Record = False,
    record_to: RecordTo = None,
) -> None:
    """Start the robot. With a goal, drive there, save the map and exit; without one, run until Ctrl-C.

    A robot without a goal maps and accepts commands from the bus: `thumper goto`, the browser page, a
    gamepad, other programs.

    --start defines the map frame. By default, the robot starts at the origin and faces along x. With --map or
    --session, the saved frame stays, and the robot first localizes in it.

    Example: `thumper run --board /dev/ttyUSB0 --lidar /dev/ttyACM0 --goal 2.0 0.5`
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
    from thumper.dashboard.process import dashboard_process
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
            dashboard_process(config, settings.bus.address, wanted=ui),
            open_robot(settings, start_pose, known) as robot,
            recorded(robot, settings, start_pose or Pose2(), record, record_to),
        ):
            _serve(robot, settings, speed, out, console)
        return
    with (
        dashboard_process(config, settings.bus.address, wanted=ui),
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
        robot.request_queue.put(LogMessage(text=text, good=good))

    def session() -> SavedSlamState:
        situation = robot.inputs.estimator.state()
        pose = situation.map_from_base if situation and not situation.lost else None
        return SavedSlamState(counts=robot.mapper.counts(), map_from_base=pose)

    robot.request_handler.handlers["save_map"] = MapSaver(robot.mapper.grid, session, out / "map.yaml", tell)
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
