"""Measure whether bus subscribers delay the robot's loop: none, several, and several that are stopped.

The robot is simulated in real time on pseudo-terminals, and its program runs in its own process, as on a real
robot. Lateness is the time from the board's telemetry to the control cycle that uses it. Busy is the work of
the cycle.
"""

import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.ros.topics import TOPICS, Direction

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.shared.live import END_WITH_PARENT

THUMPER = str(Path(sys.executable).with_name("thumper"))
MEASURE_S = 20.0
START_S = 90.0
SUBSCRIBERS = 4
SUBSCRIBE = """
import sys, time
from thumper.bus.client import BusClient
from thumper.ros.topics import TOPICS, Direction
client = BusClient("thumper", sys.argv[1])
for name, topic in TOPICS.items():
    if topic.direction is Direction.OUT:
        client.subscribe(name, lambda message: None)
print("subscribed", flush=True)
time.sleep(1e6)
"""


@contextmanager
def robot(folder: Path, address: str) -> Iterator[None]:
    """Run a stationary robot that maps."""
    board, lidar = str(folder / "board"), str(folder / "lidar")
    start = ["--start", "1.73", "0.08", "180"]
    commands = [
        [THUMPER, "sim", "--board-pty", board, "--lidar-pty", lidar, *start],
        [THUMPER, "run", "--board", board, "--lidar", lidar, *start, "--bus", address, "--out", str(folder)],
    ]
    processes = []
    try:
        for command in commands:
            processes.append(subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.DEVNULL))
            wait_for(board) if "sim" in command else connect(address).close()
        yield
    finally:
        for process in reversed(processes):
            process.send_signal(signal.SIGINT)
            process.wait(10.0)


def wait_for(path: str) -> None:
    """Wait until the simulator's port exists."""
    while not Path(path).exists():
        time.sleep(0.1)


def connect(address: str) -> BusClient:
    """Connect as soon as the robot is on its bus."""
    deadline_s = time.monotonic() + START_S
    while True:
        try:
            return BusClient("thumper", address)
        except ThumperError:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.2)


def measure(address: str) -> tuple[np.ndarray, np.ndarray]:
    """Return lateness and work [ms] of each control cycle."""
    late_ms: list[float] = []
    busy_ms: list[float] = []

    def add(status: Any) -> None:
        late_ms.append(1e3 * status.loop_late_s)
        busy_ms.append(1e3 * status.loop_busy_s)

    with BusClient("thumper", address) as client:
        client.subscribe("status", add)
        time.sleep(MEASURE_S)
    return np.array(late_ms), np.array(busy_ms)


def report(what: str, late_ms: np.ndarray, busy_ms: np.ndarray) -> None:
    """Print and record the figures of one case."""
    late, busy = (np.percentile(values, (50, 99, 100)) for values in (late_ms, busy_ms))
    print(
        f"{what:34} {late_ms.size:5} cycles   late {late[0]:6.2f} {late[1]:6.2f} {late[2]:6.2f}   "
        f"busy {busy[0]:6.2f} {busy[1]:6.2f} {busy[2]:6.2f}"
    )
    figure(f"loop at 10 Hz, {what}: late, median / 99 %", f"{late[0]:.1f} / {late[1]:.1f}", "ms")


def main() -> None:
    """Measure all cases; print median, 99th percentile and maximum."""
    out = [name for name, topic in TOPICS.items() if topic.direction is Direction.OUT]
    print(f"loop at 10 Hz, {len(out)} topics; median, p99 and maximum in ms; each for {MEASURE_S:.0f} s")
    with tempfile.TemporaryDirectory() as folder, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
        probe.close()
        with robot(Path(folder), address):
            measure(address)  # the first seconds load modules and kernels
            report("no subscriber", *measure(address))
            subscribers = []
            for _ in range(SUBSCRIBERS):
                command = [sys.executable, "-c", SUBSCRIBE, address]
                subscribers.append(subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE))
                assert subscribers[-1].stdout is not None
                subscribers[-1].stdout.readline()
            try:
                report(f"{SUBSCRIBERS} subscribers of all topics", *measure(address))
                for subscriber in subscribers:
                    subscriber.send_signal(signal.SIGSTOP)
                report(f"{SUBSCRIBERS} stopped subscribers", *measure(address))
            finally:
                for subscriber in subscribers:
                    subscriber.kill()
            report(f"{SUBSCRIBERS} killed subscribers", *measure(address))


if __name__ == "__main__":
    main()
