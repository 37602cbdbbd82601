"""Load the ROS node of a simulated robot and watch its memory: `python -m tests.host.ros2.soak --minutes 60`.

A client in this process subscribes, sends goals, cancels them and calls a service all the time.
/proc shows what `thumper ros` and `thumper run` use.
Exits with 1 if memory, threads or files of `thumper ros` grow in the second half.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.shared.live import END_WITH_PARENT, free_port
from zenoh_ros2_sdk import ROS2Subscriber, ZenohSession, get_registry

from tests.host.ros2.conftest import ROOT, Live, definitions
from tests.host.ros2.test_actions import Client, navigation_goal
from tests.host.ros2.test_services import trigger

SETTLED = 0.5  # of the time: caches fill, the map is complete
MAX_GROWTH_MB_per_h = 10.0
MIN_MINUTES = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What one process uses."""

    time_s: float
    memory_MB: float
    threads: int
    files: int


def sample(process: "subprocess.Popen[str]") -> Sample:
    """Read what a process uses now."""
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    values = {name: value.split() for name, _, value in (line.partition(":") for line in lines)}
    files = len(list(Path(f"/proc/{process.pid}/fd").iterdir()))
    memory_MB = float(values["VmRSS"][0]) / 1024
    return Sample(
        time_s=time.monotonic(), memory_MB=memory_MB, threads=int(values["Threads"][0]), files=files
    )


def load(live: Live, client: Client, turn: int) -> None:
    """Do a bit of everything: about four requests a second."""
    goal_id = client.send(navigation_goal(1.0 if turn % 2 else 1.5, 0.05))
    subscriber = ROS2Subscriber("/live/scan", "sensor_msgs/msg/LaserScan", lambda _: None, domain_id=9)
    time.sleep(0.5)
    if turn % 3:
        client.cancel(goal_id)
    client.result(goal_id)
    trigger("clear_fault")
    subscriber.close()
    for received in (live.poses, live.odometry, live.statuses, client.feedback):
        del received[:-10]


def grows(samples: list[Sample]) -> tuple[float, int, int]:
    """Return growth of memory [MB/h], threads and files between the quarters of the second half."""
    settled = samples[int(len(samples) * SETTLED) :]
    half = len(settled) // 2
    early, late = settled[:half], settled[half:]
    hours = (late[0].time_s - early[0].time_s) / 3600
    growth_MB = min(one.memory_MB for one in late) - min(one.memory_MB for one in early)
    threads = min(one.threads for one in late) - min(one.threads for one in early)
    return growth_MB / hours, threads, min(one.files for one in late) - min(one.files for one in early)


def main() -> int:
    """Run the load and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    minutes = parser.parse_args().minutes
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it, so would `ros`
    if minutes < MIN_MINUTES:
        parser.error(f"--minutes: at least {MIN_MINUTES}")
    port = free_port()
    command = [*END_WITH_PARENT, sys.executable, "-m", "tests.host.ros2.router", str(port)]
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as router,
    ):
        try:
            assert router.stdout is not None
            assert router.stdout.readline() == "ready\n"
            sdk = ZenohSession.get_instance("127.0.0.1", port)
            get_registry(str(definitions(Path(folder) / "ros")))
            live = Live(f"127.0.0.1:{free_port()}", Path(folder), port)
            processes = {"thumper ros": live.ros, "thumper run": live.robot}
            samples: dict[str, list[Sample]] = {name: [] for name in processes}
            client, turn, end_s = Client("navigate_to_pose"), 0, time.monotonic() + 60 * minutes
            while time.monotonic() < end_s:
                load(live, client, turn)
                turn += 1
                for name, process in processes.items():
                    samples[name].append(sample(process))
            live.close()
            sdk.session.close()
        finally:
            router.terminate()
    print(f"{turn} goals in {minutes:g} minutes")
    print(
        "| process | memory at half time, at the end [MB] | growth [MB/h] | threads | files |\n"
        "|---|---|---|---|---|"
    )
    leaks = False
    for name, taken in samples.items():
        growth, threads, files = grows(taken)
        half = taken[int(len(taken) * SETTLED)]
        # `make soak` watches the robot's own memory for hours.
        leaks |= name == "thumper ros" and (growth > MAX_GROWTH_MB_per_h or threads > 0 or files > 0)
        print(
            f"| `{name}` | {half.memory_MB:.1f}, {taken[-1].memory_MB:.1f} | {growth:+.1f} "
            f"| {taken[-1].threads} ({threads:+d}) | {taken[-1].files} ({files:+d}) |"
        )
    return int(leaks)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # the client library's threads do not end
