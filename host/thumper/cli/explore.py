"""`thumper explore`: map an unknown place autonomously and return to the start."""

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import (
    BoardPort,
    BusAddress,
    ConfigFile,
    Fresh,
    LidarPort,
    Record,
    RecordTo,
    RunFolder,
    Session,
    StartPose,
    Ui,
    UiPort,
)
from thumper.cli.output.interrupted import report_interrupt

if TYPE_CHECKING:
    from thumper.navigation.goal import Goal
    from thumper.runtime.loop import RobotLoop


@report_interrupt()
def explore(
    context: typer.Context,
    board: BoardPort = "",
    lidar: LidarPort = "",
    minutes: Annotated[float, typer.Option(help="Return home after this many minutes.", min=0.1)] = 15.0,
    config: ConfigFile = None,
    out: RunFolder = Path("out/explore"),
    session: Session = None,
    fresh: Fresh = False,
    start: StartPose = None,
    bus: BusAddress = "",
    ui: Ui = False,
    ui_port: UiPort = 0,
    record: Record = False,
    record_to: RecordTo = None,
) -> None:
    """Explore an unknown place until no frontier is left, return to the start and save the map.

    The robot starts at the map's origin and faces along x. With --session, it starts at --start or localizes
    itself. If the last run did not end normally (power cut, crash), the robot resumes its map. Exits with 1
    if it did not return to its start.

    If a robot is running already and neither --board nor --lidar is given, that robot explores, as on its
    page: for 15 minutes at most, from where it is. Ctrl-C cancels. `thumper save` saves its map.

    Examples:

    - `thumper explore`
    - `thumper explore --board 'sim://?world=house-4' --ui`
    - `thumper explore --board /dev/ttyUSB0 --lidar /dev/ttyACM0 --minutes 10`
    """
    if not board and not lidar and _explored_by_running_robot(context, config, bus):
        return
    from rich.console import Console

    from thumper.cli.output.drive_progress import raise_if_interrupted
    from thumper.cli.robot_run import RunOptions, opened_robot, run_and_report
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer
    from thumper.runtime.drive.exploration import BACK
    from thumper.runtime.drive.exploration import explore as explore_task

    if start is not None and (session is None or not all(map(math.isfinite, start))):
        raise ThumperError(
            "--start X Y DEGREES belongs to --session, and takes finite numbers", exit_code=EXIT_USAGE
        )
    options = RunOptions(
        config=config,
        board=board,
        lidar=lidar,
        bus=bus,
        start=start,
        session=session,
        fresh=fresh,
        out=out,
        record=record,
        record_to=record_to,
        ui=ui,
        ui_port=ui_port,
    )
    settings = options.load_settings()
    console = Console()
    with opened_robot(options, settings) as robot:
        task = explore_task(
            Explorer(ExplorationOptions(), settings.footprint),
            robot.map_and_pose,
            _home(robot, at_start=session is not None),
            limit_s=60.0 * minutes,
            report=console.print,
        )
        result = run_and_report(robot, task, out, console)
    console.print(BACK if result.reached else f"not back at the start: {result.reason}")
    raise_if_interrupted(result)
    if not result.reached:
        raise typer.Exit(1)


def _explored_by_running_robot(context: typer.Context, config: Path | None, bus: str) -> bool:
    """Let the robot that runs on the bus explore, and wait until it is back; return False if none runs.

    Raises
    ------
    ThumperError
        The robot refuses or does not come back, or an option is given that only a new robot takes.
    """
    from thumper.common.errors import EXIT_USAGE, ThumperError

    try:
        client = connect(config, bus, "")
    except ThumperError:  # nobody is there, or it needs keys or a token: a new robot checks them, too
        return False
    from thumper.cli.follow_task import follow_task  # slow
    from thumper.runtime.drive.exploration import BACK

    with client:
        sources = {name: context.get_parameter_source(name) for name in context.params}
        given = [name for name, source in sources.items() if source is not None and source.name != "DEFAULT"]
        if refused := [f"--{name.replace('_', '-')}" for name in given if name not in ("config", "bus")]:
            raise ThumperError(
                f"a robot is running: leave out {', '.join(refused)}, or end its program first",
                exit_code=EXIT_USAGE,
            )
        show = partial(print, flush=True)
        ends = f"not {BACK}"
        show(follow_task(client, "explore", is_done=lambda text: text.endswith(BACK), failed=ends, show=show))
        show("save the map with `thumper save`")
    return True


def _home(robot: "RobotLoop", *, at_start: bool) -> "Goal":
    """Return where to come back to: where the robot is now, or the map's origin.

    Raises
    ------
    ThumperError
        The robot resumes a map and cannot localize in it.
    """
    from thumper.common.errors import ThumperError
    from thumper.common.geometry import Pose2
    from thumper.runtime.drive.exploration import home_at
    from thumper.slam.mapper import SwitchesMode

    home = Pose2()
    if isinstance(robot.mapper, SwitchesMode) and robot.mapper.is_localizing:
        state = robot.wait_for_map()
        if state.lost:
            raise ThumperError(f"the robot does not know where it is: {state.lost}; pass --start")
        home = state.map_from_base if at_start else home
    return home_at(home)
