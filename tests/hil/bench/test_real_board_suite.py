"""Run `pytest hil --port`, the suite for real boards, on the emulated board behind a pseudo-terminal."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT

from thumper.board.board import Board
from thumper.board.messages import Command, Fault, ResetCause

ROOT = Path(__file__).resolve().parents[3]
THUMPER = Path(sys.executable).with_name("thumper")


def run_suite(*arguments: str | Path, answer: str = "") -> subprocess.CompletedProcess[str]:
    """Run the suite in its own process with `answer` on standard input."""
    command = [sys.executable, "-m", "pytest", "hil", "-p", "no:cacheprovider", *map(str, arguments)]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    return subprocess.run(
        command,
        cwd=ROOT,
        env=environment,
        input=answer,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@contextmanager
def served(folder: Path, *options: str) -> Iterator[Path]:
    """Yield the path of a simulated board that another process serves in real time."""
    path = folder / "board"
    paths = ["--board-pty", str(path), "--lidar-pty", str(folder / "lidar")]
    command = [str(THUMPER), "sim", *paths, "--world", "hall", *options]
    with subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        assert "Press Ctrl-C to stop" in server.stdout.readline()
        yield path
        server.send_signal(signal.SIGINT)


@pytest.fixture
def board_pty(tmp_path: Path) -> Iterator[Path]:
    """Yield a board that is reset when its port is opened."""
    with served(tmp_path, "--reset-on-open") as path:
        yield path


def test_emulated_board_passes(board_pty: Path) -> None:
    done = run_suite("--port", board_pty, "--yes", "-v")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\b11 passed", done.stdout), done.stdout
    assert "low battery" in done.stdout


def test_opening_the_port_resets_the_board(board_pty: Path) -> None:
    """As on real hardware, a client that reopens the port finds a freshly started board."""
    for _ in range(2):
        board = Board.open(str(board_pty), baud=500_000)
        assert board.identity.reset_cause is ResetCause.EXTERNAL
        assert board.poll(1.0)[-1].telemetry.time_us < 2_000_000
        time.sleep(1.0)
        board.poll(0.0)
        board.close()


@pytest.mark.slow
def test_latched_fault_is_cleared_only_on_request(tmp_path: Path) -> None:
    """A board without reset on open keeps its fault, because the user may not know of it yet."""
    with served(tmp_path) as path:
        board = Board.open(str(path), baud=500_000)
        board.command(Command.E_STOP)
        board.port.close()
        refused = run_suite("--port", path, "--yes")
        assert refused.returncode == 4
        assert "latched the fault E_STOP; nothing has moved" in refused.stdout + refused.stderr
        board = Board.open(str(path), baud=500_000)
        assert board.poll(1.0)[-1].telemetry.fault is Fault.E_STOP
        board.close()
        cleared = run_suite("--port", path, "--yes", "--clear-fault", "-k", "battery or identity")
        assert cleared.returncode == 0, cleared.stdout


def test_nothing_moves_without_consent(tmp_path: Path) -> None:
    """The suite asks before it opens the port, which does not even exist here."""
    done = run_suite("--port", tmp_path / "none", answer="no\n")
    assert done.returncode == 2
    assert "Put the robot on a block" in done.stdout
    assert "nothing has moved" in done.stdout + done.stderr


def test_missing_port_is_reported_in_one_line(tmp_path: Path) -> None:
    done = run_suite("--port", tmp_path / "none", answer="yes\n")
    assert done.returncode == 3
    assert "there is no such port" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_without_a_port_all_tests_are_skipped() -> None:
    done = run_suite("-rs")
    assert done.returncode == 0
    assert "pass --port, with the wheels off the ground" in done.stdout
