"""Shows a drive on the terminal: a progress bar; elsewhere a line every few seconds."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Column

from thumper.cli.output.status_line import PLAIN_PERIOD_S
from thumper.cli.output.stderr_report import report_to_stderr
from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
from thumper.gps.earth_reference import PLACE_UNKNOWN
from thumper.ros.codec import Message
from thumper.ros.to_ros import WARN
from thumper.runtime.drive.legs import AnyLeg, Wait
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.loop import RobotLoop

BAR_WIDTH = 20  # characters


class ProgressDisplay:
    """Shows the legs of a task, one after another."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._name = ""
        self._farthest_m = 0.0
        self._next_line_s = 0.0
        self._is_shown = True
        self._bar = self._make_bar()
        self._task = self._bar.add_task("")

    def started(self, leg: AnyLeg) -> None:
        """Start a new bar; none for a wait."""
        self._is_shown = not isinstance(leg, Wait)
        if not self._is_shown:
            return
        self._name, self._farthest_m, self._next_line_s = leg.name, 0.0, 0.0
        self._bar = self._make_bar()
        self._task = self._bar.add_task(leg.name, total=None, state="scanning the surroundings")
        self._bar.start()

    def progress(self, progress: DriveProgress) -> None:
        """Show the remaining distance."""
        distance_m = progress.distance_to_goal_m
        self._farthest_m = max(self._farthest_m, distance_m)
        state = f"{distance_m:.2f} m to go, {progress.time_s:.1f} s"
        if progress.remark:
            state += f"; {progress.remark}"
        is_plain = not (self._console.is_terminal or self._console.quiet)
        if is_plain and progress.time_s >= self._next_line_s:
            print(f"{self._name}: {state}", flush=True)
            self._next_line_s = progress.time_s + PLAIN_PERIOD_S
        self._bar.update(
            self._task, total=self._farthest_m, completed=self._farthest_m - distance_m, state=state
        )

    def ended(self, result: DriveResult | None) -> None:
        """Show the outcome and close the bar."""
        if not self._is_shown:
            return
        if result is not None and result.reached:
            state = f"reached after {result.time_s:.1f} s"
            self._bar.update(self._task, total=1.0, completed=1.0, state=state)
        elif result is not None:
            self._bar.update(self._task, state=f"not reached after {result.time_s:.1f} s")
        self._bar.stop()

    def _make_bar(self) -> Progress:
        rest = Column(ratio=1, no_wrap=True, overflow="ellipsis")
        state = TextColumn("{task.fields[state]}", table_column=rest)
        columns = TextColumn("{task.description}"), BarColumn(BAR_WIDTH), state
        return Progress(*columns, console=self._console, expand=self._console.is_terminal)


def print_problems(topic: str, _time_s: float, message: Message) -> None:
    """Print the warnings and errors among the events of a running robot, as they happen."""
    if topic == "events" and message.level >= WARN:
        report_to_stderr(message.msg)


def print_warnings(robot: RobotLoop, console: Console) -> None:
    """Print what was wrong with scans, wheels and GPS during the drive: one line per kind, with its count."""
    estimator = robot.inputs.estimator
    lines = list(estimator.warnings().values())
    if robot.inputs.has_gps and estimator.map_datum() is None:
        lines.append(PLACE_UNKNOWN)
    for line in lines:
        console.print(f"note: {line}", markup=False, soft_wrap=True)


def raise_if_interrupted(result: DriveResult) -> None:
    """Raise ThumperError with the exit code of an interrupted command, for one that would drive on."""
    if result.interrupted:
        reason = "interrupted" if result.reached else result.reason
        raise ThumperError(reason, exit_code=EXIT_INTERRUPTED)
