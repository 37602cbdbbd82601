"""Each link of the safety chain fails while the robot drives: the motors go off in time and stay off.

Everything is a process of its own: the simulated robot in real time on two pseudo-terminals, the robot's
program, and a page. Times are simulated ones, as the motors' own registers show them.
"""

import json
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from tests.e2e.conftest import THUMPER
from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.ros.codec import Message

Line = dict[str, Any]  # of the witness

HERE = Path(__file__).parent
FAR, NEAR = (0.0, 0.05), (1.5, 0.08)
PAGE_LIMIT_S = 0.7  # 300 ms, a cycle, and the ramp from 0.1 m/s
STANDS_M_S = 0.005
LINK_LIMIT_S = 0.45  # 300 ms, and a tick of the board's supervisor
STAYS_S = 0.5
DRIVING_LINES = 25  # half a second with driven motors


def _speed_m_s(before: Line, line: Line) -> float:
    duration_s = float(line["sim_s"] - before["sim_s"])
    return math.dist(before["pose"][:2], line["pose"][:2]) / max(duration_s, 1e-3)


class Chain:
    """The processes, and the motor states that the witness printed."""

    def __init__(self, folder: Path) -> None:
        board, lidar = folder / "board", folder / "lidar"
        self._said: list[Line] = []
        self.sim = subprocess.Popen(
            [
                *END_WITH_PARENT,
                sys.executable,
                str(HERE / "witness.py"),
                str(board),
                str(lidar),
                "1.73",
                "0.08",
                "180",
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        threading.Thread(target=self._listen, daemon=True).start()
        until(lambda: board.exists() and lidar.exists())
        self.address = f"127.0.0.1:{free_port()}"
        ports = ["--board", str(board), "--lidar", str(lidar), "--start", "1.73", "0.08", "180"]
        self.robot = subprocess.Popen(
            [*END_WITH_PARENT, THUMPER, "run", *ports, "--bus", self.address, "--out", str(folder)],
            stdout=subprocess.DEVNULL,
        )
        until(self._answers)
        self.client = BusClient("thumper", self.address)
        status: list[Message] = []
        self.client.subscribe("status", status.append)
        until(lambda: status and status[-1].lidar_scans > 5)  # the first scans are mapped
        self._goals = [NEAR, FAR]

    def _listen(self) -> None:
        assert self.sim.stdout is not None
        for line in self.sim.stdout:
            if line.startswith("{"):
                self._said.append(json.loads(line))

    def _answers(self) -> bool:
        try:
            BusClient("thumper", self.address).close()
        except ThumperError:
            return False
        return True

    @property
    def driven(self) -> bool:
        return bool(self._said[-1]["on"])

    @property
    def contacts(self) -> int:
        return int(self._said[-1]["contacts"])

    def next_goal(self) -> tuple[float, float]:
        self._goals.reverse()
        return self._goals[-1]

    def drive(self) -> None:
        """Send a goal and wait until the robot drives; on a busy computer the first drive may be stopped."""

        def drives() -> bool:
            x_m, y_m = self.next_goal()
            until(lambda: self._sent(x_m, y_m))
            end_s = time.monotonic() + 15.0
            while not self._moves() and time.monotonic() < end_s:
                time.sleep(0.05)
            return self._moves()

        until(drives)

    def drive_again(self) -> None:
        """Send goals until the robot drives: on a busy computer the next drive may be stopped as well."""

        def tried() -> bool:
            self._sent(*self.next_goal())
            end_s = time.monotonic() + 3.0
            while not self.driven and time.monotonic() < end_s:
                time.sleep(0.05)
            return self.driven

        until(tried)

    def _sent(self, x_m: float, y_m: float) -> bool:
        try:
            self.client.query("mission/send", {"x_m": x_m, "y_m": y_m})
        except ThumperError:
            return False  # the board has just reconnected
        return True

    def wait_for_motion(self) -> None:
        until(self._moves)

    def _moves(self) -> bool:
        return all(line["on"] for line in self._said[-DRIVING_LINES:])

    def off_after_s(self, cut: float) -> float:
        """Return the simulated time from the moment `cut` until the motors were off for good."""
        until(lambda: not self.driven)
        time.sleep(STAYS_S)
        return self._last_s(cut, lambda _before, line: bool(line["on"]))

    def stops_after_s(self, cut: float) -> float:
        """Return the simulated time from the moment `cut` until its wheels stopped for good."""
        until(lambda: not self.driven)
        time.sleep(STAYS_S)
        return self._last_s(cut, lambda before, line: _speed_m_s(before, line) > STANDS_M_S)

    def _last_s(self, cut: float, moves: Callable[[Line, Line], bool]) -> float:
        """Return the simulated time from `cut` until the last line in which the robot moves."""
        start = sum(line["wall_s"] <= cut for line in self._said)
        lines = self._said[start - 1 :]
        last = max((n for n in range(1, len(lines)) if moves(lines[n - 1], lines[n])), default=0)
        return float(lines[last + 1]["sim_s"] - lines[0]["sim_s"])

    def reason(self) -> str:
        return str(self.client.query("mission/state")["reason"])

    def close(self) -> None:
        self.client.close()
        for process in (self.robot, self.sim):
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGINT)
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chain]:
    chain = Chain(tmp_path_factory.mktemp("chain"))
    yield chain
    chain.close()


@pytest.fixture
def page(chain: Chain) -> Iterator[subprocess.Popen[str]]:
    """Return a page that drives the robot manually."""
    command = [sys.executable, str(HERE / "page.py"), chain.address]
    process = subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert "armed" in process.stdout.readline()
    chain.wait_for_motion()
    yield process
    process.kill()
    process.wait()


@pytest.mark.parametrize(
    "by",
    [
        pytest.param(signal.SIGSTOP, id="frozen"),
        pytest.param(signal.SIGKILL, id="bus cut", marks=pytest.mark.slow),
    ],
)
def test_page_gone(chain: Chain, page: subprocess.Popen[str], by: signal.Signals) -> None:
    cut_s = time.monotonic()
    page.send_signal(by)
    assert chain.stops_after_s(cut_s) <= PAGE_LIMIT_S


def test_serial_cut(chain: Chain) -> None:
    chain.drive()
    cut_s = time.monotonic()
    chain.sim.send_signal(signal.SIGUSR1)
    assert chain.off_after_s(cut_s) <= LINK_LIMIT_S
    chain.sim.send_signal(signal.SIGUSR2)
    time.sleep(STAYS_S)
    assert not chain.driven
    chain.drive()  # a new goal starts it again


def test_robot_process_hangs(chain: Chain) -> None:
    chain.drive()
    cut_s = time.monotonic()
    chain.robot.send_signal(signal.SIGSTOP)
    assert chain.off_after_s(cut_s) <= LINK_LIMIT_S
    chain.robot.send_signal(signal.SIGCONT)
    time.sleep(STAYS_S)
    assert not chain.driven
    assert "stopped the motors" in chain.reason()
    chain.drive()


def test_robot_process_killed(chain: Chain) -> None:
    chain.drive()
    cut_s = time.monotonic()
    chain.robot.kill()
    assert chain.off_after_s(cut_s) <= LINK_LIMIT_S
