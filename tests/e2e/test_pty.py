"""The same programs over serial ports: `thumper sim` at one end of two ptys, `thumper run` at the other."""

import json
import re
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT

from tests.e2e.conftest import THUMPER
from thumper.board.board import Board
from thumper.board.messages import Command, State

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.slow
def test_run_reaches_a_goal_over_serial_ports(thumper: Run, ports: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = thumper("run", "--board", ports[0], "--lidar", ports[1], "--goal", "0.8", "0", "--out", out)
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert summary["reached"]
    assert abs(summary["pose"]["x_m"] - 0.8) <= 0.11
    assert (out / "map.pgm").exists()


def test_parameters_are_set_and_saved(in_process: Run, ports: tuple[Path, Path]) -> None:
    board = ("--board", ports[0])
    shown = in_process("parameters", *board)
    assert shown.returncode == 0, shown.stderr
    assert re.search(r"kp .* 6\.1 ", shown.stdout)
    assert "saved" not in shown.stdout
    done = in_process("parameters", *board, "kp=7.5", "ks=0")
    assert "saved on the board: kp, ks" in done.stdout, done.stderr
    with closing(Board.open(str(ports[0]), baud=500_000)) as robot:
        robot.set_parameter("kp", 1.0)
        robot.command(Command.LOAD)
        assert robot.get_parameter("kp") == pytest.approx(7.5, abs=0.01)
    for wrong, line in {
        "kp": "'kp' sets no parameter; pass NAME=VALUE",
        "kq=1": "unknown parameter 'kq'",
        "kp=900": "kp = 900.0 is refused; choose 0...60",
    }.items():
        refused = in_process("parameters", *board, "ks=3", wrong)
        assert line in refused.stderr
        assert refused.returncode == 2
    assert re.search(r"ks .* 0 ", in_process("parameters", *board).stdout), "all or none"


def test_interrupt_stops_the_motors_first(ports: tuple[Path, Path], tmp_path: Path) -> None:
    board, lidar = ports
    command: list[str | Path] = [
        THUMPER,
        "run",
        "--board",
        board,
        "--lidar",
        lidar,
        "--goal",
        "1.5",
        "0",
        "--out",
        tmp_path,
    ]
    process = subprocess.Popen(
        [*END_WITH_PARENT, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for line in process.stdout:  # imports and handshake come first
        if "m to go" in line:
            break
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=10)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    assert "interrupted" in stderr
    robot = Board.open(str(ports[0]), baud=500_000)
    try:
        telemetry = robot.poll(1.0)[-1].telemetry
    finally:
        robot.close()
    assert telemetry.state is State.DISARMED
    assert (telemetry.left_pwm, telemetry.right_pwm) == (0, 0)
    assert telemetry.left_count > 100  # it was under way
