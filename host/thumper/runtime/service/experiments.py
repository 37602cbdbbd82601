"""Experiments that take the board over for a while, at the robot's own process: progress out, a stop in.

Packages bring them by the entry point `thumper.experiments`: a function that takes a `ExperimentContext`.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeVar, cast

from thumper.board.board import Board, TelemetrySample
from thumper.common.errors import ThumperError

FOLDER = Path("out") / "experiments"
MIN_LANE_M, MAX_LANE_M = 0.6, 10.0
MAX_LINES = 200
POLL_TIMEOUT_S = 0.5

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentContext:
    """What an experiment works with. All but `think` is for the thread that it was called in."""

    board: Board
    folder: Path  # for logs and the report
    lane_m: float  # free floor ahead of the robot, and as much behind it
    show: Callable[[int, int, str], None]  # done, total, what
    say: Callable[[str], None]  # a line of the result
    think: Callable[[Callable[[], Any]], Any]  # work it out elsewhere while the robot's loop goes on


Experiment = Callable[[ExperimentContext], Path | None]
"""Drives, and returns its report, an HTML page; raises ThumperError. Motors are off on every way out."""


class WatchedBoard:
    """A board whose `poll` also runs the robot's loop: it handles stop requests and publishes."""

    def __init__(self, board: Board, on_cycle: Callable[[list[TelemetrySample]], None]) -> None:
        self._board = board
        self._on_cycle = on_cycle

    def poll(self, timeout_s: float) -> list[TelemetrySample]:
        """As the board's; raises ThumperError when somebody wants the experiment to stop."""
        samples = self._board.poll(timeout_s)
        self._on_cycle(samples)
        return samples

    def __getattr__(self, name: str) -> Any:
        return getattr(self._board, name)


class Experiments:
    """At most one is asked for or runs; what the newest has said is kept."""

    def __init__(self) -> None:
        self.running = ""
        self.source = ""  # who asked for it
        self.requested = ""  # asked for, not begun
        self.stop_reason = ""
        self._lane_m = 0.0
        self._progress: tuple[int, int, str] = (0, 0, "")
        self._lines: list[str] = []
        self._problem = ""
        self._report: Path | None = None

    def request(self, content: Mapping[str, Any], source: str) -> str:
        """Note what to run at the next beat; raises ThumperError for what cannot be run."""
        name, lane_m = content.get("name"), content.get("lane_m")
        names = [point.name for point in entry_points(group="thumper.experiments")]
        if self.running or self.requested:
            raise ThumperError(f"{self.running or self.requested} is under way: cancel it first")
        if name not in names:
            raise ThumperError(f"no experiment {name!r}; there are {', '.join(sorted(names))}")
        number = isinstance(lane_m, int | float) and not isinstance(lane_m, bool)
        if not number or not MIN_LANE_M <= cast("float", lane_m) <= MAX_LANE_M:
            raise ThumperError(f"the lane is {MIN_LANE_M:g}...{MAX_LANE_M:g} m")
        self.requested, self.source, self._lane_m = name, source, float(cast("float", lane_m))
        return f"{name} begins"

    def stop(self, why: str) -> bool:
        """Have it end at the next beat; returns whether there was one."""
        self.requested = ""
        if self.running:
            self.stop_reason = why
        return bool(self.running)

    def state(self) -> dict[str, Any]:
        """What a page shows of it."""
        done, total, what = self._progress
        return {
            "running": self.running or self.requested,
            "share": done / total if total else 0.0,
            "what": what,
            "lines": list(self._lines),
            "problem": self._problem,
            "has_report": self._report is not None,
        }

    def report(self) -> dict[str, Any]:
        """The newest one's page."""
        if self._report is None:
            raise ThumperError("no experiment has left a report yet")
        return {"html": self._report.read_text(encoding="utf-8")}

    def run(self, board: Board, on_cycle: Callable[[list[TelemetrySample]], None]) -> str:
        """Run what was asked for; returns how it ended, in words. Nothing of it raises but Ctrl-C."""
        name, self.requested = self.requested, ""
        self.running, self.stop_reason, self._problem, self._report = name, "", "", None
        self._lines.clear()
        self._progress = (0, 0, "beginning")

        def beat(samples: list[TelemetrySample]) -> None:
            on_cycle(samples)
            if self.stop_reason:
                raise ThumperError(self.stop_reason)

        watched = cast("Board", WatchedBoard(board, beat))
        try:
            bench = self._workbench(watched)
            experiment: Experiment = bench.think(lambda: _load(name))  # seconds, the first time
            self._report = experiment(bench)
        except ThumperError as error:
            self._problem = str(error)
        except Exception as error:  # an experiment must not end the robot's process
            self._problem = f"internal error: {type(error).__name__}: {error}"
        finally:
            self.running = ""
        return f"{name}: {self._problem or 'done'}"

    def _workbench(self, board: Board) -> ExperimentContext:
        FOLDER.mkdir(parents=True, exist_ok=True)

        def show(done: int, total: int, what: str) -> None:
            self._progress = (done, total, what)

        def think(work: Callable[[], T]) -> T:
            pool = ThreadPoolExecutor(1)
            try:
                result = pool.submit(work)
                while not result.done():
                    board.poll(POLL_TIMEOUT_S)
                return result.result()
            finally:
                pool.shutdown(wait=False)  # who stops the experiment must not wait for what it works out

        return ExperimentContext(
            board=board,
            folder=FOLDER,
            lane_m=self._lane_m,
            show=show,
            say=lambda line: self._lines.append(line) if len(self._lines) < MAX_LINES else None,
            think=think,
        )


def _load(name: str) -> Experiment:
    (point,) = entry_points(group="thumper.experiments", name=name)
    return cast("Experiment", point.load())
