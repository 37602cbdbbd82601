"""What `run` and `explore` share: their common options, opening the robot, and the files of a run."""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import parse_qsl, urlencode, urlsplit

from rich.console import Console

from thumper.bus.serve_robot import on_bus, on_bus_if_free
from thumper.bus.zenoh_session import check_address_free
from thumper.cli.options.record import recorded
from thumper.cli.output.drive_progress import ProgressDisplay, print_warnings
from thumper.cli.output.folder import prepare_output, reserved
from thumper.cli.output.stderr_report import report_unused_ports
from thumper.cli.resume import AUTOSAVE, autosaved, keep_earlier_map, load_interrupted, set_aside_interrupted
from thumper.cli.start_map import load_start_map
from thumper.common.compile_progress import compile_progress
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import unreadable
from thumper.common.geometry import Pose2
from thumper.common.signals import hold_interrupt
from thumper.config.robot import RobotConfig, load_config, with_ports
from thumper.dashboard.process import dashboard_process
from thumper.maps.annotations import annotations_path, load_annotations
from thumper.maps.map_server_io import load_datum
from thumper.navigation.goal import Goal, check_place
from thumper.runtime.assembly import check_ports, open_robot
from thumper.runtime.drive.goal_limits import check_distances
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.loop import RobotLoop

OF_WORLD = ("world", "x_m", "y_m", "yaw_deg", "scenario")  # options of a simulated robot


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """The options that `run` and `explore` have in common."""

    config: Path | None
    board: str
    lidar: str
    bus: str
    start: tuple[float, float, float] | None  # x [m], y [m], heading [degrees]
    session: Path | None
    out: Path
    record: bool
    record_to: Path | None
    saved_map: Path | None = None
    ui: bool = False
    ui_port: int = 0  # of the dashboard; 0: as configured
    fresh: bool = False

    @property
    def start_pose(self) -> Pose2 | None:
        """Where the robot starts; None if no --start is given."""
        if self.start is None:
            return None
        x_m, y_m, heading_deg = self.start
        return Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(heading_deg))

    def in_world(self, world: str, out: Path) -> "RunOptions":
        """Return the options of the same simulated robot in another world, with a new map."""
        url = urlsplit(self.board or load_config(self.config).board.port)
        kept = [(name, value) for name, value in parse_qsl(url.query) if name not in OF_WORLD]
        board = f"sim://{url.netloc}{url.path}?{urlencode([('world', world), *kept])}"
        return replace(self, board=board, out=out, start=None, session=None, saved_map=None, fresh=True)

    def load_settings(self) -> RobotConfig:
        """Load the configuration, apply the options to it and prepare the output folder.

        Raises
        ------
        ThumperError
            --ui-port, the map, the session, the start pose, the configuration, the bus address or the folder
            is unusable.
        """
        if self.ui_port and not self.ui:
            raise ThumperError("--ui-port belongs to --ui", exit_code=EXIT_USAGE)
        for path in filter(None, (self.saved_map, self.session)):
            try:
                path.stat()  # before what comes first: a busy bus or folder
            except OSError as error:
                raise unreadable(path, error) from None
        if self.start is not None:
            check_place("--start", *self.start[:2])
        configured = load_config(self.config)
        settings = with_ports(configured, board=self.board, lidar=self.lidar)
        report_unused_ports(configured, settings)
        if self.bus:
            settings = replace(settings, bus=settings.bus.at(self.bus))
        prepare_output(self.out)
        return settings


@contextmanager
def opened_robot(
    options: RunOptions, settings: RobotConfig, *, serving: bool = False, goals: Sequence[Goal] = ()
) -> Iterator[RobotLoop]:
    """Open the robot, with recording, bus and browser page as the options say.

    A robot that is `serving` needs the bus, and saves its map on request; for a drive both are optional. If
    the last run did not end normally, the robot resumes its map at the pose that was saved last. One of
    the `goals` that is too far from the one before, or from a known start, is refused before anything opens.
    """
    if serving:
        check_ports(settings)  # a mistyped port is the nearer mistake
        check_address_free(settings.bus.address)  # the interrupted session may be that of a running robot
    with reserved(options.out), _opened(options, settings, serving, goals) as robot:
        yield robot


@contextmanager
def _opened(
    options: RunOptions, settings: RobotConfig, serving: bool, goals: Sequence[Goal]
) -> Iterator[RobotLoop]:
    known = load_start_map(settings, options.saved_map, options.session)
    start, path = options.start_pose, options.saved_map or options.session
    datum = load_datum(options.saved_map) if options.saved_map else None
    if known is None and not options.fresh and (session := load_interrupted(settings, options.out, start)):
        check_distances(goals, None)
        known, start, path = session, session.map_from_base, options.out / AUTOSAVE
    else:
        check_distances(goals, start or Pose2() if known is None else None)
        set_aside_interrupted(options.out)
    annotations = load_annotations(annotations_path(path)) if path else None
    map_path = options.out / "map.yaml" if serving else None
    join_bus = on_bus if serving else on_bus_if_free
    opened = open_robot(
        settings,
        start,
        known,
        map_path=map_path,
        annotations=annotations,
        datum=datum,
        opened=path,
        before_save=keep_earlier_map(options.out, path),
    )
    with ExitStack() as stack:
        page = stack.enter_context(
            dashboard_process(options.config, settings.bus.address, wanted=options.ui, port=options.ui_port)
        )
        with compile_progress(Console()):
            robot = stack.enter_context(opened)
        stack.enter_context(
            recorded(robot, settings, start, options.record, options.record_to, serving=serving)
        )
        stack.enter_context(join_bus(robot, settings.name, settings.bus))
        stack.enter_context(autosaved(robot, options.out))
        if page:
            Console().print(f"dashboard: {page}", soft_wrap=True)
        yield robot


def run_and_report(robot: RobotLoop, task: Task, out: Path, console: Console) -> DriveResult:
    """Run a task with a progress display; write map, pictures and summary to `out`, and print their names.

    Ctrl-C while they are written marks the result as interrupted; a second one leaves them unwritten.
    """
    result = robot.run(task, ProgressDisplay(console))
    with hold_interrupt() as held, console.status("writing the map"):
        from thumper.cli.output.run_report import write_run  # matplotlib: 27 MB that no drive needs

        robot.before_save()
        datum = robot.inputs.estimator.map_datum()
        files = write_run(out, robot.mapper, robot.annotations, robot.log, result, datum)
        print_warnings(robot, console)
        way = f"{result.path_length_m:.2f} m in {result.time_s:.1f} s"
        console.print(f"{way}; {', '.join(files)} are in {out}/", soft_wrap=True)
    return replace(result, interrupted=result.interrupted or bool(held))
