"""Whether listeners delay the robot's loop: how late it is with none, with one, with one that is stopped.

The robot is simulated in real time on pseudo-terminals and its program is a process of its own, as on a
robot. Lateness is from the board's telemetry to the beat that takes it; busy is the beat's own work.
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

import numpy as np

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.ros.topics import TOPICS, Direction

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

THUMPER = str(Path(sys.executable).with_name("thumper"))
WATCH_S = 20.0
START_S = 90.0
LISTENERS = 4
LISTEN = """
import sys, time
from thumper.bus.client import BusClient
from thumper.ros.topics import TOPICS, Direction
client = BusClient("thumper", sys.argv[1])
for name, topic in TOPICS.items():
    if topic.direction is Direction.OUT:
        client.subscribe(name, lambda message: None)
print("listens", flush=True)
time.sleep(1e6)
"""


@contextmanager
def robot(folder: Path, address: str) -> Iterator[None]:
    """A robot at service, driving to and fro by nobody's order: it stands and maps."""
    board, lidar = str(folder / "board"), str(folder / "lidar")
    place = ["--start", "1.73", "0.08", "180"]
    commands = [
        [THUMPER, "sim", "--board-pty", board, "--lidar-pty", lidar, *place],
        [THUMPER, "run", "--board", board, "--lidar", lidar, *place, "--bus", address, "--out", str(folder)],
    ]
    processes = []
    try:
        for command in commands:
            processes.append(subprocess.Popen(command, stdout=subprocess.DEVNULL))
            wait_for(board) if "sim" in command else joined(address).close()
        yield
    finally:
        for process in reversed(processes):
            process.send_signal(signal.SIGINT)
            process.wait(10.0)


def wait_for(path: str) -> None:
    """Until the simulator's port is there."""
    while not Path(path).exists():
        time.sleep(0.1)


def joined(address: str) -> BusClient:
    """Join as soon as the robot is on its bus."""
    deadline_s = time.monotonic() + START_S
    while True:
        try:
            return BusClient("thumper", address)
        except ThumperError:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.2)


def watch(address: str) -> tuple[np.ndarray, np.ndarray]:
    """Lateness and work [ms] of each beat."""
    late_ms: list[float] = []
    busy_ms: list[float] = []

    def take(status: object) -> None:
        late_ms.append(1e3 * getattr(status, "loop_late_s"))  # noqa: B009 - of a generated class
        busy_ms.append(1e3 * getattr(status, "loop_busy_s"))  # noqa: B009

    with BusClient("thumper", address) as client:
        client.subscribe("status", take)
        time.sleep(WATCH_S)
    return np.array(late_ms), np.array(busy_ms)


def tell(what: str, late_ms: np.ndarray, busy_ms: np.ndarray) -> None:
    """One line."""
    late, busy = (np.percentile(values, (50, 99, 100)) for values in (late_ms, busy_ms))
    print(
        f"{what:34} {late_ms.size:5} beats   late {late[0]:6.2f} {late[1]:6.2f} {late[2]:6.2f}   "
        f"busy {busy[0]:6.2f} {busy[1]:6.2f} {busy[2]:6.2f}"
    )
    figure(f"loop at 10 Hz, {what}: late, median / 99 %", f"{late[0]:.1f} / {late[1]:.1f}", "ms")


def main() -> None:
    """Print median, 99th percentile and maximum of both."""
    out = [name for name, topic in TOPICS.items() if topic.direction is Direction.OUT]
    print(f"loop at 10 Hz, {len(out)} topics; median, p99 and maximum in ms; each for {WATCH_S:.0f} s")
    with tempfile.TemporaryDirectory() as folder, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
        probe.close()
        with robot(Path(folder), address):
            watch(address)  # the first seconds load what is used for the first time
            tell("nobody listens", *watch(address))
            listeners = []
            for _ in range(LISTENERS):
                command = [sys.executable, "-c", LISTEN, address]
                listeners.append(subprocess.Popen(command, stdout=subprocess.PIPE))
                assert listeners[-1].stdout is not None
                listeners[-1].stdout.readline()
            try:
                tell(f"{LISTENERS} listen to everything", *watch(address))
                for listener in listeners:
                    listener.send_signal(signal.SIGSTOP)
                tell(f"{LISTENERS} are stopped and do not read", *watch(address))
            finally:
                for listener in listeners:
                    listener.kill()
            tell(f"{LISTENERS} were killed", *watch(address))


if __name__ == "__main__":
    main()
