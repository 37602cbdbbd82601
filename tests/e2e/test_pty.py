"""The same programs over serial ports: `thumper sim` at one end of two ptys, `thumper run` at the other."""

import json
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from benchmarks.shared.live import END_WITH_PARENT

from tests.e2e.conftest import THUMPER
from thumper.board.board import Board
from thumper.board.messages import State

Run = Callable[..., subprocess.CompletedProcess[str]]


def test_run_reaches_a_goal_over_serial_ports(thumper: Run, ports: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = thumper("run", "--board", ports[0], "--lidar", ports[1], "--goal", "0.8", "0", "--out", out)
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert summary["reached"]
    assert abs(summary["pose"]["x_m"] - 0.8) <= 0.11
    assert (out / "map.pgm").exists()


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
    for line in process.stdout:  # one per second in the drive; imports and handshake come first
        if re.search(r"m to go, +[2-9]", line):
            break
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
