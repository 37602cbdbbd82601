"""`thumper explore`: map an unknown place autonomously and return to the start."""

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.common_options import (
    BoardPort,
    BusAddress,
    ConfigFile,
    LidarPort,
    Record,
    RecordTo,
    RunFolder,
    Session,
    StartPose,
)
from thumper.cli.interrupted import report_interrupt

if TYPE_CHECKING:
    from rich.console import Console

    from thumper.navigation.goal import Goal
    from thumper.navigation.planners.frontier_exploration import Explorer
    from thumper.runtime.drive_result import DriveResult
    from thumper.runtime.loop import RobotLoop

HOME_TOLERANCE_M = 0.15


@report_interrupt()
def explore(
    board: BoardPort = "",
    lidar: LidarPort = "",
    minutes: Annotated[float, typer.Option(help="Return home after this many minutes.", min=0.1)] = 15.0,
    config: ConfigFile = None,
    out: RunFolder = Path("out/explore"),
    session: Session = None,
    start: StartPose = None,
    bus: BusAddress = "",
    record: Record = False,
    record_to: RecordTo = None,
) -> None:
    """Explore an unknown place until no frontier is left, return to the start and save the map.

    The robot starts at the map's origin and faces along x. With --session, it starts at --start or localizes
    itself. Exits with 1 if the robot did not return home.

    Example: `thumper explore --board /dev/ttyUSB0 --lidar /dev/ttyACM0 --minutes 10`
    """
    from rich.console import Console

    from thumper.bus.serve_robot import on_bus_if_free
    from thumper.cli.drive_progress import print_notes, raise_if_interrupted
    from thumper.cli.output_folder import prepare_output
    from thumper.cli.record_option import recorded
    from thumper.cli.run_report import write_run
    from thumper.cli.start_map import known_place
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.common.geometry import Pose2
    from thumper.config.robot import load_config, with_ports
    from thumper.navigation.goal import Goal, check_place
    from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer
    from thumper.runtime.assembly import open_robot

    if start is not None and (session is None or not all(map(math.isfinite, start))):
        raise ThumperError(
            "--start X Y DEGREES belongs to --session, and takes finite numbers", exit_code=EXIT_USAGE
        )
    if start is not None:
        check_place("--start", *start[:2])
    settings = with_ports(load_config(config), board=board, lidar=lidar)
    if bus:
        settings = replace(settings, bus=settings.bus.at(bus))
    prepare_output(out)
    known = known_place(settings, None, session)
    begin = None if known else Pose2()
    if start is not None:
        begin = Pose2(x_m=start[0], y_m=start[1], theta_rad=math.radians(start[2]))
    console = Console()
    explorer = Explorer(ExplorationOptions(), settings.footprint)
    with (
        open_robot(settings, begin, known) as robot,
        recorded(robot, settings, begin, record, record_to),
        on_bus_if_free(robot, settings.name, settings.bus),
    ):
        home = _here(robot) if known else Goal(x_m=0.0, y_m=0.0, tolerance_m=HOME_TOLERANCE_M)
        ending, result = _explore(robot, explorer, 60.0 * minutes, home, console)
        console.print(ending)
        if not result.interrupted:
            result = _home(robot, result, home, console)
        files = write_run(out, robot.mapper, robot.log, result)
        print_notes(robot, console)
    console.print(f"{'home' if result.reached else 'not home'}: {result.reason}")
    console.print(f"{', '.join(files)} are in {out}/", soft_wrap=True)
    raise_if_interrupted(result)
    if not result.reached:
        raise typer.Exit(1)


def _explore(
    robot: "RobotLoop", explorer: "Explorer", limit_s: float, home: "Goal", console: "Console"
) -> "tuple[str, DriveResult]":
    """Drive from frontier to frontier; return why exploration ended and the last drive's result.

    The result's time and distance cover all drives.
    """
    from thumper.cli.drive_progress import drive_with_progress
    from thumper.common.errors import ThumperError
    from thumper.navigation.state import NavigationState

    # The first goal is the start itself: the robot rotates in place and so gets its first map.
    result = drive_with_progress(robot, home, "look", console)
    tried, reached = 0, 0
    while (spent_s := result.time_s) < limit_s and not result.interrupted:
        goal = explorer.next_goal(robot.mapper.grid(), result.map_from_base)
        if goal is None and tried == 0:
            return "nothing here is left to explore: no border of the known can be reached", result
        if goal is None:
            return f"explored after {spent_s:.0f} s: of {tried} frontiers {reached} were reached", result
        tried += 1
        try:
            drive = drive_with_progress(robot, goal, f"frontier {tried}", console)
        except ThumperError as error:  # a frontier is a valid goal, so the robot itself cannot drive
            return f"ended after {spent_s:.0f} s: {error}", replace(result, reached=False, reason=str(error))
        result = drive.after(result)
        reached += drive.reached
        if not drive.reached and not drive.interrupted:
            if robot.drive_manager.navigator.state is not NavigationState.FAILED:  # the goal is not to blame
                return f"ended after {result.time_s:.0f} s: {result.reason}", result
            console.print(f"frontier {tried} at {goal} is left: {result.reason}")
    why = "interrupted" if result.interrupted else "time is up"
    return f"{why} after {spent_s:.0f} s: of {tried} frontiers {reached} were reached", result


def _home(robot: "RobotLoop", last: "DriveResult", home: "Goal", console: "Console") -> "DriveResult":
    """Drive home; if that fails, return the last result with the reason, so that the map is still saved."""
    from thumper.cli.drive_progress import drive_with_progress
    from thumper.common.errors import ThumperError

    try:
        back = drive_with_progress(robot, home, "home", console)
    except ThumperError as error:
        return replace(last, reached=False, reason=str(error))
    return back.after(last)


def _here(robot: "RobotLoop") -> "Goal":
    """Return the current pose as the goal to come home to.

    Raises
    ------
    ThumperError
        The robot does not know its pose.
    """
    from thumper.common.errors import ThumperError
    from thumper.navigation.goal import Goal

    situation = robot.wait_for_map()
    if situation.lost:
        raise ThumperError(f"the robot does not know where it stands: {situation.lost}; give --start")
    here = situation.map_from_base
    return Goal(x_m=here.x_m, y_m=here.y_m, tolerance_m=HOME_TOLERANCE_M)
