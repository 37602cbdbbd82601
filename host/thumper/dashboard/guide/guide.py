"""The first run, step by step. One per server: every page shows the same state.

Each step runs the `thumper` command of its name, or watches what the page makes the running robot do.
"""

import asyncio
import re
import tempfile
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal

from thumper.board.fault_texts import ARMED_STATES
from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.config.robot import load_config
from thumper.dashboard.board_parameters import Parameters
from thumper.dashboard.display_data import Row
from thumper.dashboard.guide.command import StepCommand
from thumper.dashboard.guide.robot_file import Ports, write_robot_file
from thumper.dashboard.guide.robot_watch import RobotWatch, WatchedBus
from thumper.ros import services
from thumper.ros.services import ExperimentState, NamedMap
from thumper.ros.to_ros import text as text_message

WATCH_PERIOD_S = 0.25
SAVE_TIMEOUT_S = 30.0  # of a robot that saves its map at the end
START_TIMEOUT_S = 300.0  # of `thumper run`, which compiles at its first start
SIMULATOR_TIMEOUT_S = 120.0
FIRST_DRIVE_M = 0.3
MISSION_END = re.compile(r"(?:goal|route) .*? (reached|not reached|ended)(?:: | after )")
EXPLORED = re.compile(r"explored: |.*; back at the start$")
RETURNING = re.compile(r"(explored|time is up) after ")  # without "back at the start"
KEPT = "kept the old gains: "  # how the result of a tuning begins that brought no better ones
NO_BETTER = "the new gains are no better; the board uses the old ones again"
TRACKING = re.compile(r"tracking error at (\S+ rad/s²) (\S+) → (\S+) rad/s(, no change)?")
SAVED, NOT_SAVED = "map saved: ", "the map was not saved: "
STOPPED = "emergency stop"  # the problem of an experiment that it ended
TURNED = "motor forward"  # in the lines of the wheel check


class Step(StrEnum):
    """The steps in order."""

    ROBOT = "robot"
    FLASH = "flash"
    CHECK = "check"
    START = "start"
    TUNE = "tune"
    DRIVE = "drive"
    MAP = "map"
    GOAL = "goal"
    SAVE = "save"
    DONE = "done"


STEPS = tuple(Step)


Verdict = Literal["pass", "warn", "fail", "skip"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepOutcome:
    """How a step ended, in one line with the fix."""

    verdict: Verdict
    text: str


def judge_check(lines: list[str]) -> StepOutcome:
    """Judge the report of `thumper doctor --spin`: a wheel that turns the wrong way must be fixed first."""
    failed = [line.removeprefix("fail").strip() for line in lines if line.startswith("fail")]
    turned = [line for line in lines if TURNED in line]
    wrong = [line.removeprefix("fail").strip() for line in turned if line.startswith("fail")]
    if wrong:
        return StepOutcome(verdict="fail", text=wrong[0])
    if len(turned) < 2:
        return StepOutcome(verdict="fail", text=failed[0] if failed else "the wheels were not turned")
    if failed:
        return StepOutcome(verdict="warn", text=f"both sides turn forward, but {failed[0]}")
    return StepOutcome(verdict="pass", text="both sides turn forward, and each encoder counts its own side")


def progress_text(state: ExperimentState) -> str:
    """Return what an experiment does, and its share if that is known."""
    return f"{state.share:.0%}: {state.what}" if state.share else state.what


def tracking_changes(state: ExperimentState) -> str:
    """Return in words how the tracking error of each ramp changed by tuning."""
    return "; ".join(_change_text(found) for line in state.lines if (found := TRACKING.match(line)))


def _change_text(found: re.Match[str]) -> str:
    ramp, before, after, no_change = found.groups()
    share = float(after) / float(before) - 1.0
    change = "as before" if no_change else f"{abs(share):.0%} {'less' if share < 0.0 else 'more'} than before"
    return f"while they speed up at {ramp}, the wheels miss their speed by {after} rad/s, {change}"


def tuned_text(state: ExperimentState) -> str:
    """Return what tuning brought."""
    if state.what.startswith(KEPT):
        return f"{NO_BETTER}: {tracking_changes(state)}"
    return f"{tracking_changes(state)}. The board uses the new gains. Keep them?"


class Guide:
    """State and actions of the first run. Use it in the server's event loop only."""

    def __init__(self, bus_address: str, *, config: Path | None = None, ports: Ports | None = None) -> None:
        """`config` with its `ports` is an existing configuration, which is used as it is."""
        self.step = Step.ROBOT
        self.outcomes: dict[Step, StepOutcome] = {}
        self.config = config
        self.ports = ports
        self.is_tuned = False  # and the user has to choose: keep the gains or not
        self.saved_map: Path | None = None
        self._is_tuning = False
        self._change = ""  # of the tracking error, by tuning
        self.busy: Step | None = None
        self.watch = RobotWatch()
        self._bus_address = bus_address
        self._robot: WatchedBus | None = None
        self._command: StepCommand | None = None  # of the step
        self._simulator: StepCommand | None = None  # of the bare board
        self._run: StepCommand | None = None  # `thumper run`
        self._tasks: set[asyncio.Task[int]] = set()
        self._terminals = tempfile.TemporaryDirectory(prefix="thumper-setup-")

    def connect(self, robot: WatchedBus) -> None:
        """Use the bus of the robot that the guide will start."""
        self._robot = robot
        self.watch.connect(robot)

    @property
    def lines(self) -> list[str]:
        """What the command of this step has printed."""
        command = self._run if self.step is Step.START else self._command
        return list(command.lines) if command else []

    @property
    def rows(self) -> list[Row]:
        """The wheels' speeds during the wheel check, as rows of the charts."""
        return self._command.rows if self.step is Step.CHECK and self._command else []

    def begin(self, step: Step) -> None:
        """Show a step, unless one is running."""
        if self.busy is not None:
            return
        if step is not self.step:
            self._disarm()
        self.step = step
        self._command = None
        self.watch.restart()

    def repeat(self) -> None:
        """Forget the outcome of this step, which begins again."""
        self.outcomes.pop(self.step, None)
        self.begin(self.step)

    @property
    def progress(self) -> str:
        """The step in words for the dashboard; empty once the guide is done."""
        done = self.step is Step.DONE
        return "" if done else f"step {STEPS.index(self.step) + 1} of {len(STEPS) - 1}"

    @property
    def has_robot(self) -> bool:
        """Whether the guide has started `thumper run`."""
        return self._run is not None

    @property
    def is_moving(self) -> bool:
        """Whether the step moves the robot now."""
        status = self.watch.status
        explores = self.step is Step.MAP and status is not None and status.mode == "driving"
        return explores or self.busy in (Step.CHECK, Step.TUNE)

    @property
    def is_armed(self) -> bool:
        """Whether the motors may turn."""
        status = self.watch.status
        return status is not None and status.board_state in ARMED_STATES

    def _disarm(self) -> None:
        """Switch the motors off, which the user may have armed for a step; a drive of its own goes on."""
        status = self.watch.status
        if self.is_armed and status is not None and status.mode != "driving":
            self._connected.publish("command", text_message("disarm"))

    def advance(self) -> None:
        """Go on to the next step; this one counts as skipped unless it has succeeded."""
        outcome = self.outcomes.get(self.step)
        if self.busy is None and (outcome is None or outcome.verdict in ("fail", "skip")):
            self._set("skip", "skipped")
        self.begin(STEPS[STEPS.index(self.step) + 1])

    def interrupt(self) -> None:
        """End the wheel check, whose motors must not turn any longer."""
        if self._command is not None and self.busy is Step.CHECK:
            self._command.interrupt()

    async def choose_robot(self, name: str, ports: Ports) -> None:
        """Write the configuration, or use the given one; start the bare board of a simulated robot."""

        async def choose() -> str:
            await self._end_simulator()  # of an earlier choice
            if self.config is None or self.ports is None:
                self.config, self.ports = write_robot_file(Path(), name, ports), ports
            return await self._chosen(self.ports)

        await self._do(choose)

    async def use_file(self, path: Path) -> None:
        """Use a configuration that exists, as it is."""

        async def choose() -> str:
            settings = load_config(path)
            await self._end_simulator()
            self.config = path
            self.ports = Ports(board=settings.board.port, lidar=settings.lidar.port)
            return await self._chosen(self.ports)

        await self._do(choose)

    async def _chosen(self, ports: Ports) -> str:
        """Start the bare board of a simulated robot; return what was chosen."""
        if ports.simulated:
            await self._start_simulator()
            return f"a simulated robot: bare board, wheels in the air; {self.config}"
        return f"board {ports.board}, lidar {ports.lidar}: {self.config}"

    async def flash(self, board: str, bootloader: str) -> None:
        """Run `thumper flash`."""

        async def flash() -> str:
            command = self._new("flash", "--board", self._port("board"))
            if not self._simulator:
                command = self._new(*command.arguments, "--model", board, "--bootloader", bootloader)
            if await command.run() != 0:
                raise ThumperError(command.last_line)
            return f"written and verified: {command.last_line}"

        await self._do(flash)

    async def check(self) -> None:
        """Run `thumper doctor --spin`; the user has confirmed that no wheel touches anything."""

        async def check() -> str:
            ports = ("--board", self._port("board"), "--lidar", self._port("lidar"))
            command = self._new("doctor", "--config", str(self.config), *ports, "--spin", "--speeds")
            status = await command.run(answer="y\n")
            if command.is_interrupted:
                raise ThumperError("stopped: the wheels are not checked")
            if status not in (0, EXIT_CHECK_FAILED):
                raise ThumperError(command.last_line)
            outcome = judge_check(self.lines)
            self._set(outcome.verdict, outcome.text)
            return outcome.text

        await self._do(check)

    async def start(self) -> None:
        """Run `thumper run` and wait for its first status."""

        async def start() -> str:
            await self._end_simulator()
            await self._end_run()
            bus = ("--bus", self._bus_address)
            self._run = run = StepCommand("run", "--config", str(self.config), *bus, "--fresh")
            await self._until_ready(run, lambda: self.watch.status is not None, START_TIMEOUT_S)
            return f"thumper run --config {self.config}"

        await self._do(start)

    async def keep_gains(self) -> None:
        """Save the gains in use on the board."""

        async def keep() -> str:
            await asyncio.to_thread(Parameters(self._connected).save)
            return f"the board keeps the new gains: {self._change}"

        await self._do(keep)

    async def drop_gains(self) -> None:
        """Return to the gains saved on the board."""

        async def drop() -> str:
            await asyncio.to_thread(Parameters(self._connected).revert)
            return "the board uses its saved gains again"

        await self._do(drop)

    async def save(self, name: str) -> None:
        """Save the map under a new name in the robot's library."""

        async def save() -> str:
            request = NamedMap(name=name)
            self.watch.restart()
            await asyncio.to_thread(services.LIBRARY_SAVE.call, self._connected, request)
            files = await self._saved_files()
            self.saved_map = Path(files[0]).with_suffix(".yaml")  # beside the image, the first of them
            return f"saved {', '.join(files)}"

        await self._do(save)

    async def _saved_files(self) -> list[str]:
        """Wait for the robot's report of the map's files; raise ThumperError if they were not written."""
        end_s = time.monotonic() + SAVE_TIMEOUT_S
        while time.monotonic() < end_s:
            for text in self.watch.events():
                if text.startswith(NOT_SAVED):
                    raise ThumperError(text)
                if text.startswith(SAVED):
                    return text.removeprefix(SAVED).split(", ")
            await asyncio.sleep(WATCH_PERIOD_S)
        raise ThumperError(f"the robot did not report its map in {SAVE_TIMEOUT_S:g} s; look under Map")

    async def run(self) -> None:
        """Follow what the robot does, until cancelled."""
        while True:
            await asyncio.sleep(WATCH_PERIOD_S)
            with suppress(ThumperError):
                await self._follow()

    async def close(self) -> None:
        """End the commands; the robot saves its map."""
        self.interrupt()
        await self._end_run()
        await self._end_simulator()
        self._terminals.cleanup()

    async def _follow(self) -> None:
        is_free = self.busy in (None, Step.TUNE)  # tuning ends with the robot
        if self._run is not None and not self._run.is_running and is_free and self._is_driving:
            self.busy = None
            self.begin(Step.START)
            self._set("fail", f"the robot has stopped: {self._run.last_line}")
        elif self.step is Step.TUNE:
            await self._follow_tuning()
        elif self.step is Step.DRIVE and self.watch.manual_m >= FIRST_DRIVE_M:
            self._set("pass", f"drove {self.watch.manual_m:.2f} m")
        elif self.step in (Step.MAP, Step.GOAL):
            for text in self.watch.events():
                self._follow_event(text)

    @property
    def _is_driving(self) -> bool:
        return STEPS.index(self.step) > STEPS.index(Step.START)

    async def _follow_tuning(self) -> None:
        if self.watch.status is None:
            return
        state = await asyncio.to_thread(services.EXPERIMENT_STATE.call, self._connected)
        if state.running:
            self.busy, self.is_tuned, self._is_tuning = Step.TUNE, False, True
            self._set("warn", progress_text(state))
        elif self._is_tuning:
            self.busy, self._is_tuning = None, False
            self.is_tuned = not state.problem and not state.what.startswith(KEPT)
            self._change = tracking_changes(state)
            if state.problem == STOPPED:
                self._set("skip", "stopped; press Tune to begin again")
            else:
                self._set("fail" if state.problem else "pass", state.problem or tuned_text(state))

    def _follow_event(self, text: str) -> None:
        if match := MISSION_END.match(text):
            self._set("pass" if match[1] == "reached" else "fail", text)
        elif EXPLORED.match(text):
            self._set("pass", text)
        elif RETURNING.match(text):
            self._set("warn", f"{text}; driving back to the start")
        elif text.startswith(("not back at the start: ", "ended after ", "interrupted after ")):
            self._set("fail", text)

    async def _do(self, action: Callable[[], Awaitable[str]]) -> None:
        """Run the action of this step, then go on to the next; a failure becomes its outcome."""
        if self.busy is not None:
            return
        step = self.busy = self.step
        self.outcomes.pop(step, None)
        try:
            text = await action()
        except ThumperError as error:
            self._set("fail", str(error))
        else:
            if step not in self.outcomes:
                self._set("pass", text)
        finally:
            self.busy = None
        if self.outcomes[step].verdict == "pass":
            self.advance()

    def _set(self, verdict: Verdict, text: str) -> None:
        self.outcomes[self.step] = StepOutcome(verdict=verdict, text=text)

    def _new(self, *arguments: str) -> StepCommand:
        self._command = StepCommand(*arguments)
        return self._command

    def _port(self, device: Literal["board", "lidar"]) -> str:
        if self._simulator is not None:
            return str(Path(self._terminals.name) / device)
        return str(getattr(self.ports, device))

    @property
    def _connected(self) -> WatchedBus:
        if self._robot is None:
            raise ThumperError("the robot is not connected")
        return self._robot

    async def _start_simulator(self) -> None:
        folder = Path(self._terminals.name)
        board, lidar = folder / "board", folder / "lidar"
        ports = ("--board-pty", str(board), "--lidar-pty", str(lidar))
        self._simulator = command = StepCommand("sim", *ports, "--bare", "--floor", "stand")
        try:
            await self._until_ready(command, lidar.exists, SIMULATOR_TIMEOUT_S)
        except ThumperError:
            self._simulator = None
            raise

    async def _until_ready(
        self, command: StepCommand, is_ready: Callable[[], bool], timeout_s: float
    ) -> None:
        """Run a command in the background until it is ready; raise ThumperError if it ends or hangs."""
        name = f"thumper {command.arguments[0]}"
        task = asyncio.create_task(command.run_in_background(SAVE_TIMEOUT_S))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        begin_s = time.monotonic()
        while not is_ready():
            seconds = time.monotonic() - begin_s
            self._set("warn", f"{name} is starting: {seconds:.0f} s")
            if task.done():
                raise ThumperError(command.last_line or f"{name} has ended")
            if seconds > timeout_s:
                await command.stop(SAVE_TIMEOUT_S)
                raise ThumperError(f"{name} was not ready in {timeout_s:g} s: {command.last_line}")
            await asyncio.sleep(WATCH_PERIOD_S)
        self.outcomes.pop(self.step, None)

    async def _end_simulator(self) -> None:
        if self._simulator is not None:
            await self._simulator.stop()
            self._simulator = None

    async def _end_run(self) -> None:
        if self._run is not None:
            await self._run.stop(SAVE_TIMEOUT_S)
            self._run = None
