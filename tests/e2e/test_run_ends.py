"""However a running robot ends, its map is not lost."""

import os
import pty
import signal
import subprocess
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port

from tests.e2e.conftest import THUMPER

SIM = ("--board", "sim://end/board?world=lab", "--lidar", "sim://end/lidar")


def test_the_end_of_the_terminal_ends_the_drive_and_keeps_the_map(tmp_path: Path) -> None:
    """As after a dropped ssh connection: SIGHUP, and a terminal that takes no more output."""
    master, slave = pty.openpty()
    command = [str(THUMPER), "explore", *SIM, "--out", str(tmp_path)]
    process = subprocess.Popen([*END_WITH_PARENT, *command], stdout=slave, stderr=slave)
    os.close(slave)
    seen = b""
    while b"frontier 1" not in seen:
        seen += os.read(master, 4096)
    os.close(master)
    process.send_signal(signal.SIGHUP)
    process.wait(60)
    assert {"map.yaml", "map.pgm", "map.session"} <= {path.name for path in tmp_path.iterdir()}
    assert "autosave.session" not in {path.name for path in tmp_path.iterdir()}


def test_a_robot_that_serves_saves_its_map_at_ctrl_c(tmp_path: Path) -> None:
    command = [str(THUMPER), "run", *SIM, "--bus", f"127.0.0.1:{free_port()}", "--out", str(tmp_path)]
    process = subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert "It serves `thumper goto`" in process.stdout.readline()
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(3.0)
    another = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert "is another robot process running?" in another.stderr
    assert another.stdout == "", "it takes the map of the running robot for that of an interrupted one"
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "map.yaml, map.session" in output
    assert {path.name for path in tmp_path.iterdir()} == {"map.yaml", "map.pgm", "map.session"}
