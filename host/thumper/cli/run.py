"""`thumper run`: start the robot; drive to the given goals and exit, or run until Ctrl-C."""

import math
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.common import (
    BoardPort,
    BusAddress,
    ClearFault,
    ConfigFile,
    Fresh,
    GoalTolerance,
    LidarPort,
    Record,
    RecordTo,
    RunFolder,
    SavedMap,
    Session,
    StartPose,
    Ui,
    UiPort,
)
from thumper.cli.output.interrupted import report_interrupt

if TYPE_CHECKING:
    from rich.console import Console

    from thumper.cli.robot_run import RunOptions
    from thumper.runtime.drive.waypoints import Waypoints


@report_interrupt()
def run(
    context: typer.Context,
    goal: Annotated[
        tuple[float, float] | None,
        typer.Option("--goal", metavar="X Y", help="Goal in the map, in metres."),
    ] = None,
    heading: Annotated[
        float | None, typer.Option(help="Heading at --goal, in degrees from the x axis.")
    ] = None,
    goal_gps: Annotated[
        tuple[float, float] | None,
        typer.Option("--goal-gps", metavar="LAT LON", help="Goal on Earth, in degrees; needs --map."),
    ] = None,
    waypoint: Annotated[
        list[str] | None,
        typer.Option(metavar="X Y", help="Waypoint before --goal, in metres; repeat for more."),
    ] = None,
    patrol: Annotated[
        int, typer.Option(help="Number of rounds over the waypoints and the goal.", min=1, max=10_000)
    ] = 1,
    wait: Annotated[
        float, typer.Option(help="Wait at each waypoint and the goal, in seconds.", min=0.0, max=3600.0)
    ] = 0.0,
    route: Annotated[
        Path | None,
        typer.Option(
            help="TOML file of waypoints with headings, waits, recordings and beeps, for the options above."
        ),
    ] = None,
    board: BoardPort = "",
    lidar: LidarPort = "",
    start: StartPose = None,
    saved_map: SavedMap = None,
    session: Session = None,
    fresh: Fresh = False,
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
    ui: Ui = False,
    ui_port: UiPort = 0,
    record: Record = False,
    record_to: RecordTo = None,
) -> None:
    """Start the robot. With a goal, drive there, save the map and exit; without one, run until Ctrl-C.

    A robot without a goal maps and accepts commands from the bus: `thumper goto`, the dashboard, a
    gamepad, other programs.

    --start defines the map frame. By default, the robot starts at the origin and faces along x. With --map or
    --session, the saved frame stays, and the robot first localizes in it. If the last run did not end
    normally (power cut, crash), the robot resumes its map.

    Examples:

    - `thumper run --board sim:// --ui`
    - `thumper run --board /dev/ttyUSB0 --lidar /dev/ttyACM0 --goal 2.0 0.5`
    """
    from rich.console import Console

    from thumper.cli.robot_run import RunOptions
    from thumper.cli.route import load_route
    from thumper.common.errors import EXIT_USAGE, ThumperError

    if goal_gps is not None:
        goal = _place_of(goal_gps, goal, saved_map)
    places = [*map(_parse_place, waypoint or []), *([goal] if goal else [])]
    if not all(map(math.isfinite, (*chain(*places), *(start or ()), tolerance, heading or 0.0))):
        raise ThumperError(
            "--goal, --heading, --waypoint and --start take finite numbers", exit_code=EXIT_USAGE
        )
    if heading is not None and goal is None:
        raise ThumperError("--heading belongs to --goal X Y", exit_code=EXIT_USAGE)
    if patrol > 1 and not places:
        raise ThumperError("--patrol belongs to --waypoint X Y or --goal X Y", exit_code=EXIT_USAGE)
    if route is not None:
        names = ("goal", "goal_gps", "heading", "waypoint", "patrol", "wait", "tolerance")
        _refuse_given(context, names, "a run without --route, whose file says it")
    elif not places:
        need = "--goal, --waypoint or --route; `thumper goto` has its own"
        _refuse_given(context, ("tolerance", "clear_fault", "wait"), need)
    if places or route is not None:
        _refuse_given(context, ("speed",), "a run without a goal")
    waypoints = _waypoints(places, heading, tolerance, patrol, wait)
    if route is not None:
        waypoints = load_route(route, saved_map, session)
    options = RunOptions(
        config=config,
        board=board,
        lidar=lidar,
        bus=bus,
        start=start,
        saved_map=saved_map,
        session=session,
        fresh=fresh,
        out=out,
        record=record,
        record_to=record_to,
        ui=ui,
        ui_port=ui_port,
    )
    if waypoints is None:
        _serve(options, speed, Console())
    else:
        _drive(options, waypoints, Console(), clear_fault=clear_fault)


def _refuse_given(context: typer.Context, names: tuple[str, ...], need: str) -> None:
    """Raise ThumperError for an option that is given but has no effect in this run."""
    from thumper.common.errors import EXIT_USAGE, ThumperError

    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            option = f"--{name.replace('_', '-')}"
            raise ThumperError(f"{option} belongs to {need}", exit_code=EXIT_USAGE)


def _serve(options: "RunOptions", speed: float, console: "Console") -> None:
    """Serve the requests of clients until Ctrl-C, in each simulated world that they choose."""
    world, first_out = _serve_in_one_world(options, speed, console), options.out
    while world:
        console.print(f"the robot starts again in the world {world}")
        options = options.in_world(world, first_out / world)
        world = _serve_in_one_world(options, speed, console)


def _serve_in_one_world(options: "RunOptions", speed: float, console: "Console") -> str:
    """Serve the requests of clients; return the simulated world that they chose, empty after Ctrl-C."""
    from thumper.cli.output.drive_progress import print_problems, print_warnings
    from thumper.cli.resume import save_map_and_session
    from thumper.cli.robot_run import opened_robot
    from thumper.runtime.loop import UNCONFIRMED

    settings = options.load_settings()
    page = "the dashboard" if options.ui else "`thumper dashboard`"
    with opened_robot(options, settings, serving=True) as robot:
        console.print(
            f"{settings.name} is running on {settings.bus.address}. "
            f"It serves `thumper goto`, `thumper teleop` and {page}. Press Ctrl-C to stop.",
            soft_wrap=True,
        )
        robot.publisher.add_sink(print_problems)
        simulation = robot.request_handler.simulation
        simulation.can_restart = True
        is_stopped = robot.serve(speed=speed)
        files = save_map_and_session(robot, options.out)
        print_warnings(robot, console)
    saved = f"{', '.join(files)} are in {options.out}/" if files else "there was no map to save"
    console.print(f"{'stopped' if is_stopped else UNCONFIRMED}; {saved}", soft_wrap=True)
    return simulation.next_world


def _drive(options: "RunOptions", waypoints: "Waypoints", console: "Console", *, clear_fault: bool) -> None:
    """Drive to all waypoints and report the result; raise ThumperError if one is not reached."""
    from thumper.cli.output.drive_progress import raise_if_interrupted
    from thumper.cli.robot_run import opened_robot, run_and_report
    from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
    from thumper.runtime.drive.tasks import follow_waypoints
    from thumper.runtime.service.recorded_wait import recorded_wait

    goals = [leg.goal for leg in waypoints.legs()]
    with opened_robot(options, options.load_settings(), goals=goals) as robot:
        handlers = robot.request_handler.handlers
        task = follow_waypoints(
            waypoints,
            clear_fault=clear_fault,
            on_beep=lambda _name: console.bell(),
            recording=lambda: recorded_wait(robot.publisher, lambda name: handlers[name]()),
        )
        result = run_and_report(robot, task, options.out, console)
    if not result.reached:
        raise ThumperError(
            f"goal not reached: {result.reason}", exit_code=EXIT_INTERRUPTED if result.interrupted else 1
        )
    console.print(result.reason)
    raise_if_interrupted(result)


def _waypoints(
    places: list[tuple[float, float]],
    heading_deg: float | None,
    tolerance_m: float,
    rounds: int,
    wait_s: float,
) -> "Waypoints | None":
    """Return the places as waypoints, the heading at the last one; None without places."""
    from thumper.navigation.goal import Goal, check_place
    from thumper.runtime.drive.waypoints import Waypoints

    for place in places:
        check_place("the goal", *place)
    if not places:
        return None
    goals = [Goal(x_m=x_m, y_m=y_m, tolerance_m=tolerance_m) for x_m, y_m in places]
    if heading_deg is not None:
        goals[-1] = replace(goals[-1], theta_rad=math.radians(heading_deg))
    return Waypoints.at(*goals, rounds=rounds, wait_s=wait_s)


def _place_of(
    goal_gps: tuple[float, float], goal: tuple[float, float] | None, saved_map: Path | None
) -> tuple[float, float]:
    """Return a goal on Earth as x and y in the saved map; raise ThumperError without its datum."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.gps.local_plane import LatLon
    from thumper.maps.map_server_io import load_datum
    from thumper.runtime.requests import place_in_map

    place = LatLon(*goal_gps)
    place.check()
    if goal is not None:
        raise ThumperError("--goal and --goal-gps are both goals: pass only one", exit_code=EXIT_USAGE)
    datum = None if saved_map is None else load_datum(saved_map)
    if datum is None:
        raise ThumperError(
            "--goal-gps needs a --map whose YAML has a datum; a run with [gps] saves one",
            exit_code=EXIT_USAGE,
        )
    return place_in_map(place, datum)


def _parse_place(text: str) -> tuple[float, float]:
    from thumper.common.errors import EXIT_USAGE, ThumperError

    try:
        x_m, y_m = map(float, text.split(","))
    except ValueError as error:
        raise ThumperError(
            f"--waypoint {text.replace(',', ' ')}: give X Y in metres, as in --waypoint 1.0 -0.5",
            exit_code=EXIT_USAGE,
        ) from error
    return x_m, y_m
