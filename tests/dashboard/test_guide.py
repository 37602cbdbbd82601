"""The parts of the first run's guide, without a browser."""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, TypeVar
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pytest
from benchmarks.shared.live import until

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.robot import load_config
from thumper.dashboard.guide import guide as guide_module
from thumper.dashboard.guide.command import StepCommand
from thumper.dashboard.guide.guide import KEPT, NO_BETTER, Guide, Step, judge_check, progress_text
from thumper.dashboard.guide.robot_file import (
    WORLDS,
    Ports,
    free_name,
    simulated_ports,
    write_robot_file,
)
from thumper.dashboard.guide.robot_watch import RobotWatch
from thumper.dashboard.guide.step_controls import LANE_M
from thumper.dashboard.page_commands import PageCommands, TeleopLimits
from thumper.dashboard.page_messages import EStop
from thumper.ros.services import ExperimentState
from thumper.ros.status import Status
from thumper.ros.to_ros import Messages
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.options import BenchOptions
from thumper_hil.world.load_world import load_world

SIMULATED = simulated_ports()
REAL = Ports(board="/dev/ttyUSB0", lidar="/dev/ttyUSB1", lidar_model="ld19")

Result = TypeVar("Result")


def in_own_loop(work: Coroutine[Any, Any, Result]) -> Result:
    """Run in a thread of its own: the browser's driver may run a loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result()


def test_written_configuration_has_the_ports_and_a_low_speed(tmp_path: Path) -> None:
    settings = load_config(write_robot_file(tmp_path, "robot.toml", REAL))
    assert (settings.board.port, settings.lidar.port, settings.lidar.model) == (
        "/dev/ttyUSB0",
        "/dev/ttyUSB1",
        "ld19",
    )
    assert settings.navigation.limits.v_max_m_s == 0.2


@pytest.mark.parametrize("world", WORLDS)
def test_each_world_has_a_free_lane_for_tuning(world: str) -> None:
    options = BenchOptions.parse(dict(parse_qsl(urlsplit(simulated_ports(world).board).query)))
    walls = load_world(options.world)
    for x_m in np.arange(-LANE_M, LANE_M + 0.01, 0.05):
        assert walls.clearance_m(options.start @ Pose2(x_m=float(x_m)), FOOTPRINT_M) > 0.1


def test_a_configuration_that_exists_stays(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("mine")
    with pytest.raises(ThumperError, match=r"stays as it is; .*`thumper setup --config robot.toml"):
        write_robot_file(tmp_path, "robot.toml", REAL)
    assert (tmp_path / "robot.toml").read_text() == "mine"


def test_a_configuration_that_exists_is_used_or_a_new_name_is_proposed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert free_name(tmp_path) == "robot.toml"
    before = write_robot_file(tmp_path, "robot.toml", REAL).read_text()
    assert free_name(tmp_path) == "robot_2.toml"
    guide = Guide("127.0.0.1:1")
    in_own_loop(guide.use_file(Path("robot.toml")))
    assert guide.step is Step.FLASH
    assert guide.ports is not None
    assert (guide.config, guide.ports.board) == (Path("robot.toml"), REAL.board)
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]
    assert (tmp_path / "robot.toml").read_text() == before
    (tmp_path / "robot.toml").write_text("[board")
    guide = Guide("127.0.0.1:1")
    in_own_loop(guide.use_file(Path("robot.toml")))
    assert (guide.step, guide.outcomes[Step.ROBOT].verdict) == (Step.ROBOT, "fail")


@pytest.mark.parametrize("name", ["", "../robot.toml", "robot", "/tmp/a.toml", ".toml", "a b.toml"])
def test_a_path_is_no_file_name(tmp_path: Path, name: str) -> None:
    with pytest.raises(ThumperError, match="use letters"):
        write_robot_file(tmp_path, name, REAL)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("board", "lidar"), [("", "/dev/a"), ("/dev/a", ""), ("/dev/a", "/dev/a")])
def test_both_ports_are_needed(tmp_path: Path, board: str, lidar: str) -> None:
    with pytest.raises(ThumperError, match="choose the board's port"):
        write_robot_file(tmp_path, "robot.toml", Ports(board=board, lidar=lidar))


def test_a_failed_command_becomes_the_outcome_and_the_step_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    guide = Guide("127.0.0.1:1", config=tmp_path / "robot.toml", ports=REAL)
    guide.begin(Step.FLASH)
    in_own_loop(guide.flash("trex", "old"))
    assert guide.step is Step.FLASH
    assert guide.busy is None
    assert guide.outcomes[Step.FLASH].verdict == "fail"
    assert guide.outcomes[Step.FLASH].text.startswith("cannot open the board port /dev/ttyUSB0: there is no")


LEFT = "pass  left motor forward: left encoder +204, right encoder +0 counts"
RIGHT = "pass  right motor forward: right encoder +218, left encoder +0 counts"
BACKWARD = "fail  right motor forward: right encoder -218, left encoder +0 counts: wrong direction"


@pytest.mark.parametrize(
    ("lines", "verdict", "text"),
    [
        (["pass  battery 7.66 V", LEFT, RIGHT], "pass", "both sides turn forward, and"),
        (["fail  telemetry: jitter 240 ms", LEFT, RIGHT], "warn", "but telemetry: jitter 240 ms"),
        ([LEFT, BACKWARD, "fail  lidar"], "fail", "right encoder -218"),
        ([LEFT, "fail  board: sent nothing"], "fail", "board: sent nothing"),
        (["pass  battery 7.66 V"], "fail", "not turned"),
    ],
)
def test_only_wheels_that_turn_forward_pass_the_check(lines: list[str], verdict: str, text: str) -> None:
    outcome = judge_check(lines)
    assert outcome.verdict == verdict
    assert text in outcome.text


def test_emergency_stop_and_a_closed_page_interrupt_the_command() -> None:
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    guide.busy = Step.CHECK
    interrupted: list[str] = []
    guide._command = SimpleNamespace(interrupt=lambda: interrupted.append("now"))  # type: ignore[assignment]
    bus = SimpleNamespace(publish=lambda *_arguments, **_options: None)
    commands = PageCommands(bus, TeleopLimits(v_m_s=0.4, w_rad_s=1.0), lambda: None)
    commands.on_stop = guide.interrupt
    commands.handle("page", EStop(kind="estop"))
    assert interrupted == ["now"]
    commands.on_disconnect("page")
    assert interrupted == ["now", "now"]
    guide.busy = Step.FLASH  # half a firmware is worse than none
    commands.on_disconnect("page")
    assert interrupted == ["now", "now"]


def test_an_interrupt_before_the_start_ends_the_command() -> None:
    async def run() -> int:
        command = StepCommand("watch", "--bus", "127.0.0.1:1")
        command.interrupt()
        return await asyncio.wait_for(command.run(), 120)

    assert in_own_loop(run()) != 0


def test_only_manual_driving_counts() -> None:
    watch, messages = RobotWatch(), Messages()

    def drive(mode: str, *places: float) -> None:
        watch.on_status(messages.status(Status(time_s=0.0, mode=mode)))
        for x_m in places:
            watch.on_pose(messages.pose(0.0, Pose2(x_m=x_m)))

    drive("driving", 0.0, 0.4)
    assert watch.manual_m == 0.0
    drive("manual", 0.5, 0.4, 9.0)  # the last one is a correction
    assert watch.manual_m == pytest.approx(0.2)
    watch.restart()
    assert watch.manual_m == 0.0


def test_a_run_that_ends_while_it_tunes_frees_the_guide() -> None:
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    guide.begin(Step.TUNE)
    guide.busy = Step.TUNE
    guide._run = SimpleNamespace(is_running=False, last_line="the board is gone")  # type: ignore[assignment]
    in_own_loop(guide._follow())
    assert [guide.step, guide.busy] == [Step.START, None]
    assert guide.outcomes[Step.START].text == "the robot has stopped: the board is gone"


@pytest.mark.parametrize(
    ("mode", "board_state", "sent"),
    [("manual", "CLOSED_LOOP", ["disarm"]), ("driving", "CLOSED_LOOP", []), ("idle", "DISARMED", [])],
)
def test_a_robot_armed_for_a_step_is_disarmed_after_it(mode: str, board_state: str, sent: list[str]) -> None:
    published: list[str] = []
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    guide._robot = SimpleNamespace(publish=lambda _topic, message: published.append(message.data))
    guide.begin(Step.DRIVE)
    guide.watch.on_status(Messages().status(Status(time_s=0.0, mode=mode, board_state=board_state)))
    guide.repeat()
    assert published == []
    guide.advance()
    assert (guide.step, published) == (Step.MAP, sent)


LINES = [
    "tracking error at 4 rad/s² 0.150 → 0.080 rad/s",
    "tracking error at 8 rad/s² 0.210 → 0.205 rad/s, no change beyond the noise of ±0.010",
]
CHANGE = (
    "while they speed up at 4 rad/s², the wheels miss their speed by 0.080 rad/s, 47% less than before; "
    "while they speed up at 8 rad/s², the wheels miss their speed by 0.205 rad/s, as before"
)


def guide_after_tuning(*states: ExperimentState) -> Guide:
    """Return a guide whose robot has reported these states of its tuning."""
    replies = [{"ok": True, **asdict(state)} for state in states]
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    guide.watch = SimpleNamespace(status=Status(time_s=0.0), restart=lambda: None)  # type: ignore[assignment]
    guide._robot = SimpleNamespace(query=lambda *_arguments, **_options: replies.pop(0))
    guide.begin(Step.TUNE)
    for _ in states:
        in_own_loop(guide._follow_tuning())
    return guide


@pytest.mark.parametrize(
    ("last", "is_tuned", "text"),
    [
        (
            f"the board uses the new gains: {LINES[0]}",
            True,
            f"{CHANGE}. The board uses the new gains. Keep them?",
        ),
        (f"{KEPT}{LINES[1]}", False, f"{NO_BETTER}: {CHANGE}"),
    ],
)
def test_tuning_ends_with_its_figures_and_only_better_gains_are_a_question(
    last: str, is_tuned: bool, text: str
) -> None:
    state = ExperimentState(
        running="tune", share=0.5, what=last, lines=[*LINES, last], problem="", has_report=True
    )
    guide = guide_after_tuning(state, replace(state, running=""))
    assert (guide.is_tuned, guide.busy) == (is_tuned, None)
    assert guide.outcomes[Step.TUNE].text == text


def test_the_dashboard_shows_the_step_until_the_guide_is_done() -> None:
    guide = Guide("127.0.0.1:1")
    guide.begin(Step.TUNE)
    assert guide.progress == "step 5 of 9"
    guide.begin(Step.DONE)
    assert guide.progress == ""


def test_a_stopped_tuning_begins_again_and_may_be_skipped() -> None:
    state = ExperimentState(running="tune", share=0.5, what="", lines=[], problem="", has_report=False)
    guide = guide_after_tuning(state, replace(state, running="", problem="emergency stop"))
    outcome = guide.outcomes[Step.TUNE]
    assert (outcome.verdict, outcome.text) == ("skip", "stopped; press Tune to begin again")
    guide._set("fail", "the lane is too short")
    guide.advance()
    assert (guide.step, guide.outcomes[Step.TUNE].verdict) == (Step.DRIVE, "skip")
    guide._set("pass", "drove 0.31 m")
    guide.advance()
    assert guide.outcomes[Step.DRIVE].verdict == "pass"


def test_a_map_is_saved_once_the_robot_reports_its_files() -> None:
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    reports = ["map saved: maps/den.pgm, den.yaml, den.session", "the map was not saved: no space left"]
    events: list[str] = []
    watch = SimpleNamespace(status=None, events=lambda: events, restart=events.clear)
    guide.watch = watch  # type: ignore[assignment]

    def save(*_arguments: Any, **_options: Any) -> dict[str, Any]:
        events.append(reports.pop(0))
        return {"ok": True, "text": ""}

    guide._robot = SimpleNamespace(query=save)
    guide.begin(Step.SAVE)
    in_own_loop(guide.save("den"))
    assert (guide.step, guide.saved_map) == (Step.DONE, Path("maps/den.yaml"))
    guide.begin(Step.SAVE)
    in_own_loop(guide.save("den"))
    assert (guide.step, guide.outcomes[Step.SAVE].verdict) == (Step.SAVE, "fail")


def test_progress_of_unknown_length_has_no_share() -> None:
    state = ExperimentState(
        running="tune", share=0.0, what="computing", lines=[], problem="", has_report=False
    )
    assert progress_text(state) == "computing"
    assert progress_text(replace(state, share=0.25, what="recording")) == "25%: recording"


@pytest.mark.parametrize(
    ("event", "verdict"),
    [
        ("goal (0.50, -0.50) m reached after 4.1 s", "pass"),
        ("explored after 30 s: reached 2 of 2 frontiers; back at the start", "pass"),
        ("time is up after 900 s: reached 2 of 4 frontiers; back at the start", "pass"),
        ("explored: no frontier is left, the map has 16.0 m² of free floor", "pass"),
        ("not back at the start: no path", "fail"),
        ("goal (60.00, 0.00) m not reached: no path", "fail"),
        ("route of 3 goals ended: cancelled", "fail"),
    ],
)
def test_each_end_of_a_mission_or_exploration_is_the_outcome_of_the_step(event: str, verdict: str) -> None:
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    guide.begin(Step.GOAL)
    guide._follow_event("navigating")
    assert not guide.outcomes
    guide._follow_event(event)
    assert (guide.outcomes[Step.GOAL].verdict, guide.outcomes[Step.GOAL].text) == (verdict, event)


def test_an_exploration_is_over_once_the_robot_is_back() -> None:
    guide = Guide("127.0.0.1:1", config=Path("robot.toml"), ports=SIMULATED)
    guide.begin(Step.MAP)
    guide._follow_event("explored after 30 s: reached 2 of 2 frontiers")
    assert guide.outcomes[Step.MAP].verdict == "warn"
    assert guide.outcomes[Step.MAP].text.endswith("driving back to the start")
    guide._follow_event("explored after 30 s: reached 2 of 2 frontiers; back at the start")
    assert guide.outcomes[Step.MAP].verdict == "pass"


class Simulator(StepCommand):
    """A simulator that hangs before its ports are there."""

    running: ClassVar[set[StepCommand]] = set()

    async def run_in_background(self, end_timeout_s: float) -> int:
        self.running.add(self)
        await asyncio.sleep(600.0)
        return 0

    async def stop(self, timeout_s: float = 0.0) -> None:
        self.running.discard(self)


def test_a_simulator_that_does_not_start_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guide_module, "StepCommand", Simulator)
    monkeypatch.setattr(guide_module, "SIMULATOR_TIMEOUT_S", 0.3)
    guide = Guide("127.0.0.1:1", config=tmp_path / "robot.toml", ports=SIMULATED)
    in_own_loop(guide.choose_robot("", SIMULATED))
    assert guide.busy is None
    assert guide.outcomes[Step.ROBOT].text.startswith("thumper sim was not ready in 0.3 s")
    assert not Simulator.running


def test_one_simulator_runs_also_if_the_guide_ends_before_it_is_ready(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guide_module, "StepCommand", Simulator)
    guide = Guide("127.0.0.1:1", config=tmp_path / "robot.toml", ports=SIMULATED)

    async def run() -> None:
        for _ in range(2):
            guide.begin(Step.ROBOT)
            choice = asyncio.create_task(guide.choose_robot("", SIMULATED))
            while not Simulator.running:
                await asyncio.sleep(0.01)
            (Path(guide._terminals.name) / "lidar").touch()
            await choice
            assert len(Simulator.running) == 1
            (Path(guide._terminals.name) / "lidar").unlink()
        guide.begin(Step.ROBOT)
        choice = asyncio.create_task(guide.choose_robot("", SIMULATED))
        await asyncio.sleep(0.1)
        assert guide.outcomes[Step.ROBOT].text == "thumper sim is starting: 0 s"
        await guide.close()
        assert not Simulator.running
        choice.cancel()

    in_own_loop(run())


PARENT = """
import asyncio, sys
from thumper.dashboard.guide.command import StepCommand

asyncio.run(StepCommand(*sys.argv[1:]).run_in_background(30.0))
"""


def test_a_command_in_the_background_ends_with_the_guide(tmp_path: Path) -> None:
    board, lidar = tmp_path / "board", tmp_path / "lidar"
    ports = ("--board-pty", str(board), "--lidar-pty", str(lidar))
    parent = subprocess.Popen([sys.executable, "-c", PARENT, "sim", *ports, "--bare", "--floor", "stand"])
    until(lidar.exists)
    os.kill(parent.pid, signal.SIGKILL)  # no chance to clean up
    parent.wait()
    until(lambda: not lidar.is_symlink())
