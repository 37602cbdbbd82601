"""Runs the installed command in its own process, as a user does."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.shared.live import END_WITH_PARENT

from tests.e2e.service import START, Service
from tests.host.cli.conftest import Ended
from tests.host.cli.conftest import thumper as here
from thumper.board.options import BoardOptions
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.runtime.assembly import open_robot
from thumper_hil.bench import simulation

__all__ = ["here"]

THUMPER = Path(sys.executable).with_name("thumper")


@pytest.fixture
def thumper() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return a function that runs `thumper` with some arguments to its end."""

    def run(*arguments: str | Path, timeout_s: float = 120.0) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*END_WITH_PARENT, THUMPER, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )

    return run


@pytest.fixture
def in_process(here: Callable[..., Ended]) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return a function as that of `thumper` that starts no process, which takes 0.5 to 2 s of CPU time."""

    def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        ended = here(*map(str, arguments))
        return subprocess.CompletedProcess(arguments, ended.status, ended.out, ended.err)

    return run


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    """Return a running robot that has mapped its first scans."""
    board = f"sim://service/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = RobotConfig(board=BoardOptions(port=board), lidar=LidarOptions(port="sim://service/lidar"))
    with open_robot(config, START) as robot:
        service = Service(robot, simulation("service"))
        for part in ("service.request_handler", "service.request_queue", "drive.drive_manager"):
            clock = SimpleNamespace(monotonic=service.wall_s)
            monkeypatch.setattr(f"thumper.runtime.{part}.time", clock)
        service.run_cycles(8)
        yield service


@pytest.fixture
def ports(tmp_path: Path) -> Iterator[tuple[Path, Path]]:
    """Return the ports of a simulated robot in the lab that runs in real time."""
    board, lidar = tmp_path / "board", tmp_path / "lidar"
    command: list[str | Path] = [THUMPER, "sim", "--board-pty", board, "--lidar-pty", lidar, "--world", "lab"]
    process = subprocess.Popen([*END_WITH_PARENT, *command, "--start", "0", "0", "0"])
    try:
        deadline = time.monotonic() + 30
        while not (board.exists() and lidar.exists()):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
        yield board, lidar
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(10) in (0, 130)
    assert not board.is_symlink()  # the simulator removed it
