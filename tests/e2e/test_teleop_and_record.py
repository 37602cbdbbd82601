"""A running robot, driven from a keyboard and recorded over the bus, each in its own process."""

import os
import pty
import signal
import subprocess
import termios
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from tests.e2e.conftest import THUMPER
from thumper.board.messages import State
from thumper.bus.client import BusClient
from thumper.recording.reader import Recording, find_recordings
from thumper.recording.replay import replay
from thumper.ros.to_ros import text

BOARD = "sim://e2e/board?world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"
START_TIMEOUT_S = 60.0


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the configuration of a robot on a free port."""
    folder = tmp_path_factory.mktemp("robot")
    path = folder / "robot.toml"
    path.write_text(
        f'name = "handy"\n[board]\nport = "{BOARD}"\n[lidar]\nport = "sim://e2e/lidar"\n'
        f'[bus]\naddress = "127.0.0.1:{free_port()}"\n[recording]\nfolder = "{folder / "own"}"\n'
    )
    return path


@pytest.fixture(scope="module")
def robot(config: Path) -> Iterator[Path]:
    """Run the robot's process for the tests of this file."""
    command: list[str | Path] = [
        THUMPER,
        "run",
        "--config",
        config,
        "--start",
        "1.73",
        "0.08",
        "180",
        "--out",
        config.parent / "out",
    ]
    with subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert "is running on" in process.stdout.readline()
        yield config
        process.send_signal(signal.SIGINT)
        process.wait(START_TIMEOUT_S)
        assert process.returncode == 0


@pytest.fixture
def client(robot: Path) -> Iterator[BusClient]:
    from thumper.config.robot import load_config

    settings = load_config(robot)
    with BusClient(settings.name, settings.bus.address) as joined:
        yield joined


def test_a_held_key_drives_and_a_killed_program_stops(robot: Path, client: BusClient) -> None:
    wheels: list[Any] = []
    client.subscribe("wheels", wheels.append)
    until(lambda: wheels)
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [*END_WITH_PARENT, THUMPER, "teleop", "--config", robot, "--no-gamepad"],
        stdin=theirs,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        while b"armed |" not in process.stdout.read1():  # type: ignore[attr-defined]
            pass  # until it shows the robot's state: a key that is held at the start does not count

        os.write(ours, b"r")
        until(lambda: wheels[-1].state == State.CLOSED_LOOP)

        def hold() -> bool:
            os.write(ours, b"i")
            time.sleep(0.05)
            return bool(wheels[-1].left_speed_mrad_s > 1500 and wheels[-1].right_speed_mrad_s > 1500)

        until(hold)
        assert wheels[-1].state == State.CLOSED_LOOP
        os.kill(process.pid, signal.SIGKILL)
        killed_us = wheels[-1].time_us
        until(lambda: wheels[-1].left_setpoint_mrad_s < wheels[-2].left_setpoint_mrad_s)
        assert wheels[-1].time_us - killed_us <= 600_000  # a command is valid for 0.3 s, plus two cycles
        until(lambda: wheels[-1].left_speed_mrad_s == wheels[-1].right_speed_mrad_s == 0)
    with subprocess.Popen(process.args, stdin=theirs, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        while b"armed |" not in process.stdout.read1():  # type: ignore[attr-defined]
            pass
        os.write(ours, b"q")
        assert b"the robot is still armed; `thumper stop` switches the motors off" in process.stdout.read()
    os.close(ours)
    os.close(theirs)


def test_early_keys_do_nothing_and_who_armed_disarms(robot: Path, client: BusClient) -> None:
    wheels: list[Any] = []
    client.subscribe("wheels", wheels.append)
    client.publish("command", text("disarm"))
    until(lambda: wheels and wheels[-1].state == State.DISARMED)
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    command: list[str | Path] = [*END_WITH_PARENT, THUMPER, "teleop", "--config", robot, "--no-gamepad"]
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs) as process:
        shown = os.read(ours, 1024)
        assert shown.startswith(b"\r\x1b[Kconnecting to the robot ...")
        os.write(ours, b"iriq")
        while b"disarmed |" not in shown:
            shown += os.read(ours, 1024)
        assert b"iri" not in shown
        assert wheels[-1].state == State.DISARMED
        os.write(ours, b"r")
        until(lambda: wheels[-1].state == State.CLOSED_LOOP)
        os.write(ours, b"q")
        while b"disarmed, because this program armed it" not in shown:
            shown += os.read(ours, 1024)
        assert process.wait(START_TIMEOUT_S) == 0
    assert termios.tcgetattr(theirs) == before
    assert wheels[-1].state == State.DISARMED
    os.close(ours)
    os.close(theirs)


def test_recording_in_a_second_process_and_in_the_robot(
    robot: Path, client: BusClient, tmp_path: Path
) -> None:
    beside = subprocess.Popen(
        [*END_WITH_PARENT, THUMPER, "record", "--config", robot, "--out", tmp_path, "--seconds", "6"],
        stdout=subprocess.PIPE,
    )
    status: list[Any] = []
    client.subscribe("status", status.append)
    client.publish("command", text("record_start"))
    until(lambda: status and status[-1].recording)
    time.sleep(3.0)
    client.publish("command", text("record_stop"))
    until(lambda: not status[-1].recording)
    assert beside.wait(60.0) == 0
    own = robot.parent / "own"
    until(lambda: not list(own.glob("*.part")))
    for folder, least_s in ((tmp_path, 4.0), (own, 2.0)):
        recording = Recording(find_recordings([folder]))
        session = recording.run_metadata()
        assert session is not None
        assert session.config.name == "handy"
        assert "schema" in session.firmware
        out = replay(recording)
        assert out.time_s > least_s
        assert out.scans > 15


def start(config: Path) -> "subprocess.Popen[str]":
    """Start a robot's process and wait until it is on the bus."""
    command: list[str | Path] = [
        *(THUMPER, "run", "--config", config, "--start", "1.73", "0.08", "180"),
        *("--out", config.parent / "restarted"),
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert any(
        "is running on" in line for line in process.stdout
    )  # after a kill, the saved session comes first
    return process


@pytest.mark.slow
def test_programs_go_on_when_the_robot_restarts(tmp_path: Path) -> None:
    config, folder = tmp_path / "robot.toml", tmp_path / "recordings"
    config.write_text(
        f'name = "phoenix"\n[board]\nport = "{BOARD}"\n[lidar]\nport = "sim://e2e/lidar"\n'
        f'[bus]\naddress = "127.0.0.1:{free_port()}"\n'
    )
    robot = start(config)
    ours, theirs = pty.openpty()
    watched = tmp_path / "watched"
    shown = tmp_path / "teleop"
    with watched.open("wb") as out, shown.open("wb") as screen:
        programs: list[subprocess.Popen[Any]] = [
            subprocess.Popen([THUMPER, "watch", "wheels", "--json", "--config", config], stdout=out),
            subprocess.Popen([THUMPER, "record", "--config", config, "--out", folder]),
            subprocess.Popen(
                [THUMPER, "teleop", "--config", config, "--no-gamepad"], stdin=theirs, stdout=screen
            ),
        ]
    try:
        until(lambda: watched.stat().st_size > 0 and b"disarmed |" in shown.read_bytes())
        until(lambda: list(folder.glob("*.mcap.part")))
        time.sleep(2.0)
        robot.kill()
        robot.wait()
        seen, lines = len(shown.read_bytes()), watched.read_bytes().count(b"\n")
        robot = start(config)
        until(lambda: watched.read_bytes().count(b"\n") > lines + 10)
        until(lambda: b"disarmed |" in shown.read_bytes()[seen:])
        os.write(ours, b"r")
        until(lambda: b"\x1b[Karmed |" in shown.read_bytes()[seen:])  # it commands the new process
        time.sleep(2.0)
    finally:
        programs.append(robot)
        for program in programs:
            program.send_signal(signal.SIGINT)
        codes = [program.wait(START_TIMEOUT_S) for program in programs]
        os.close(ours)
        os.close(theirs)
    assert codes == [0, 0, 0, 0]
    files = sorted(folder.glob("*.mcap"))
    assert len(files) == 2
    for file in files:  # one recording per run
        assert replay(Recording((file,))).scans > 5
