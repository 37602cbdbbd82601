"""Ctrl-C ends a command that would drive on: no next mission, no next frontier."""

import signal
import subprocess
from pathlib import Path

import pytest

from tests.e2e.conftest import THUMPER

ON_SIM = ["--board", "sim://r/board?world=lab", "--lidar", "sim://r/lidar"]
COMMANDS = {
    "demo": (["demo"], "straight run", "round a paper box"),
    "explore": (
        ["explore", "--board", "sim://r/board?world=lab", "--lidar", "sim://r/lidar"],
        "frontier 1",
        "home",
    ),
}


@pytest.mark.parametrize(("arguments", "under_way", "next_drive"), COMMANDS.values(), ids=COMMANDS)
def test_nothing_is_driven_after_an_interrupt(
    arguments: list[str], under_way: str, next_drive: str, tmp_path: Path
) -> None:
    command = [str(THUMPER), *arguments, "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
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
