"""Ctrl-C ends a command: at once while it loads, and before the next mission or frontier in a drive."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port

from tests.e2e.conftest import THUMPER
from tests.variants import some_of

ON_SIM = ["--board", "sim://r/board?world=lab", "--lidar", "sim://r/lidar"]
COMMANDS = {
    "demo": (["demo"], "straight run", "around a paper box"),
    "explore": (
        ["explore", "--board", "sim://r/board?world=lab", "--lidar", "sim://r/lidar"],
        "frontier 1",
        "\nhome: ",
    ),
}


@pytest.mark.parametrize(("arguments", "under_way", "next_drive"), COMMANDS.values(), ids=COMMANDS)
def test_no_drive_starts_after_ctrl_c(
    arguments: list[str], under_way: str, next_drive: str, tmp_path: Path
) -> None:
    command = [str(THUMPER), *arguments, "--out", str(tmp_path)]
    process = subprocess.Popen(
        [*END_WITH_PARENT, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for line in process.stdout:
        if under_way in line and "m to go" in line:
            break
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=30)
    assert process.returncode == 130, errors
    assert next_drive not in rest
    assert "interrupted" in errors
    assert "Traceback" not in errors


def test_ctrl_c_while_the_map_is_written_waits_for_it(tmp_path: Path) -> None:
    script = (
        "import os, signal\n"
        "import thumper.cli.output.run_report as report\n"
        "write = report.write_run\n"
        "def write_run(*arguments):\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    return write(*arguments)\n"
        "report.write_run = write_run\n"
        "from thumper.__main__ import main\n"
        "main()\n"
    )
    arguments = ["run", *ON_SIM, "--bus", f"127.0.0.1:{free_port()}", "--goal", "0.4", "0"]
    done = subprocess.run(
        [*END_WITH_PARENT, sys.executable, "-c", script, *arguments, "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (130, "thumper: interrupted\n")
    assert f"summary.json are in {tmp_path}/\nat the goal (0.40, 0.00)" in done.stdout
    assert (tmp_path / "map.session").exists()
    assert not (tmp_path / "autosave.session").exists()


@pytest.mark.parametrize("command", some_of(["run", "explore"]))
def test_ctrl_c_reports_the_motors_while_waiting_for_the_board(command: str, tmp_path: Path) -> None:
    """Nothing answers on the port; the handshake request shows that the command waits."""
    master, slave = os.openpty()
    ports = ["--board", os.ttyname(slave), "--lidar", "/dev/null"]
    if command == "run":
        ports += ["--bus", f"127.0.0.1:{free_port()}"]
    process = subprocess.Popen(
        [*END_WITH_PARENT, str(THUMPER), command, *ports, "--out", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert select.select([master], [], [], 60.0)[0], "it has ended, or does not ask"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    os.close(master)
    os.close(slave)
    assert (process.returncode, errors) == (130, "thumper: interrupted; the motors are off\n")


def test_ctrl_c_ends_a_command_that_still_loads(tmp_path: Path) -> None:
    """A slow stand-in for the first imported library gives the test time."""
    (tmp_path / "typer.py").write_text("import time\nprint('loading', flush=True)\ntime.sleep(60)\n")
    process = subprocess.Popen(
        [*END_WITH_PARENT, sys.executable, "-m", "thumper", "status"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (130, "")


def test_a_second_ctrl_c_during_the_first_ends_without_a_traceback() -> None:
    script = (
        "import thumper.cli.app as app\n"
        "def interrupted(): raise KeyboardInterrupt\n"
        "app.main = interrupted\n"
        "from thumper.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "")
