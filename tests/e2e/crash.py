"""Kill a running robot at random moments: each restart must go on in the same map and find its pose.

python -m tests.e2e.crash --kills 200        (about an hour)

The simulated robot is a process of its own, runs in real time and stays where it was. `thumper run` gets the
same command line each time, as from systemd.
"""

import argparse
import json
import math
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from thumper.bus.client import BusClient
from thumper.cli.resume import AUTOSAVE
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, wrap_angle
from thumper.ros import services
from thumper.ros.codec import Message
from thumper.ros.services import Empty, SendMission
from thumper.slam.saved_state import load_session

HERE = Path(__file__).parent
START = Pose2(x_m=1.0, y_m=0.0, theta_rad=math.pi)
GOALS_M = ((1.0, 0.0), (-0.4, 0.2), (0.4, -0.9), (0.9, 1.0), (1.9, 0.4))
CELL_M = 0.05
LONGEST_LOSS_S = 5.0
FIND_S = 60.0  # a robot whose pose was 3 s old may have to drive a metre to be sure
REST_M = 0.002


@dataclass(frozen=True, slots=True, kw_only=True)
class Restart:
    """What one kill and the restart after it cost."""

    lost_s: float  # time of mapping since the last save when the process was killed
    error_m: float  # of the pose that was found
    error_rad: float
    kept: float  # fraction of the walls before the kill that the map has after it


class CrashTest:
    """The simulated robot, and the process that is killed."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._folder, self._rng = folder, np.random.default_rng(seed)
        self._ports = [folder / "board", folder / "lidar"]
        place = (str(START.x_m), str(START.y_m), str(math.degrees(START.theta_rad)))
        command = [*END_WITH_PARENT, sys.executable, str(HERE / "witness.py"), *map(str, self._ports), *place]
        self._sim = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self._true = deque[tuple[float, float, float]](maxlen=25)  # half a second
        threading.Thread(target=self._listen, daemon=True).start()
        until(lambda: all(port.exists() for port in self._ports))
        self._robot: subprocess.Popen[str] | None = None
        self._client: BusClient | None = None
        self._mapping_since_s = time.time()

    def _listen(self) -> None:
        assert self._sim.stdout is not None
        for text in self._sim.stdout:
            if text.startswith("{") and (pose := json.loads(text)["pose"]):
                self._true.append(tuple(pose))

    def start(self) -> tuple[BusClient, deque[Pose2]]:
        """Start the robot; return a client of it, and the newest pose that it publishes."""
        address = f"127.0.0.1:{free_port()}"
        board, lidar = map(str, self._ports)
        start = ["--start", str(START.x_m), str(START.y_m), str(math.degrees(START.theta_rad))]
        self._robot = subprocess.Popen(
            [
                *(*END_WITH_PARENT, sys.executable, "-m", "thumper", "run", "--board", board),
                *("--lidar", lidar, *start, "--bus", address, "--out", str(self._folder)),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        poses = deque[Pose2](maxlen=1)
        client = self._client = until(lambda: _connected(address))
        client.subscribe("pose", lambda message: poses.append(_pose(message)))
        return client, poses

    def drive_until_found(self, client: BusClient, poses: deque[Pose2]) -> tuple[float, float]:
        """Drive until the robot maps again; return the error of its pose at rest [m, rad]."""
        until(lambda: poses and not _mapping(client).lost, FIND_S)
        end_s = time.monotonic() + FIND_S
        while _mapping(client).mode != "mapping":
            assert time.monotonic() < end_s, f"not found: {_mapping(client)}"
            self._send_goal(client)
            time.sleep(1.0)
        self._mapping_since_s = time.time()  # before, the robot only looked for its pose: nothing to save
        with suppress(ThumperError):
            client.query("command", {"command": "cancel"})
        until(self._is_at_rest)
        time.sleep(0.5)
        true, found = self._true[-1], poses[-1]
        error_m = math.hypot(found.x_m - true[0], found.y_m - true[1])
        return error_m, abs(wrap_angle(found.theta_rad - true[2]))

    def _is_at_rest(self) -> bool:
        first, last = self._true[0], self._true[-1]
        return len(self._true) == self._true.maxlen and math.dist(first[:2], last[:2]) < REST_M

    def _send_goal(self, client: BusClient) -> None:
        x_m, y_m = GOALS_M[self._rng.integers(len(GOALS_M))]
        try:
            services.MISSION_SEND.call(client, SendMission(x_m=x_m, y_m=y_m))
        except ThumperError:
            time.sleep(0.3)  # not yet, or not there: another one next time

    def kill(self, client: BusClient, after_s: float) -> float:
        """Drive for a while, then kill the robot; return how long it had mapped since the last save [s]."""
        assert self._robot is not None
        path, end_s = self._folder / AUTOSAVE, time.monotonic() + after_s
        while time.monotonic() < end_s:
            self._send_goal(client)
            time.sleep(min(1.5, max(0.0, end_s - time.monotonic())))
        self._robot.send_signal(signal.SIGKILL)
        killed_s = time.time()
        self._robot.wait(10)
        client.close()
        return killed_s - max(path.stat().st_mtime if path.exists() else 0.0, self._mapping_since_s)

    def walls(self) -> set[tuple[int, int]]:
        """Return the cells of the saved session that beams have hit."""
        counts = load_session(self._folder / AUTOSAVE, CELL_M).counts
        cells = np.argwhere(counts.hits > 2) + counts.first_cell
        return {(int(row), int(col)) for row, col in cells}

    def close(self) -> None:
        """End the processes; an open client would keep this one alive."""
        if self._client is not None:
            self._client.close()
        for process in (self._robot, self._sim):
            if process is not None and process.poll() is None:
                process.kill()  # in the background, SIGINT may be ignored
                process.wait(10)


def _connected(address: str) -> BusClient | None:
    try:
        return BusClient("thumper", address)
    except ThumperError:
        return None


def _mapping(client: BusClient) -> services.MappingState:
    state: services.MappingState = until(lambda: _mapping_now(client))
    return state


def _mapping_now(client: BusClient) -> services.MappingState | None:
    try:
        return services.MAPPING_STATE.call(client, Empty())
    except ThumperError:
        return None  # a busy computer: the robot opens its ports again


def _pose(message: Message) -> Pose2:
    pose = message.pose.pose
    return Pose2(
        x_m=pose.position.x,
        y_m=pose.position.y,
        theta_rad=2.0 * math.atan2(pose.orientation.z, pose.orientation.w),
    )


def crashes(kills: int, seed: int, folder: Path) -> Iterator[Restart]:
    """Kill the robot so many times; yield what each restart cost."""
    test = CrashTest(folder, seed)
    rng = np.random.default_rng(seed)
    try:
        client, poses = test.start()
        test.drive_until_found(client, poses)
        test.kill(client, 6.0)
        for _ in range(kills):
            walls = test.walls()
            client, poses = test.start()
            error_m, error_rad = test.drive_until_found(client, poses)
            lost_s = test.kill(client, rng.uniform(0.0, 8.0))
            kept = len(walls & _grown(test.walls())) / len(walls)
            yield Restart(lost_s=lost_s, error_m=error_m, error_rad=error_rad, kept=kept)
    finally:
        test.close()


def _grown(cells: set[tuple[int, int]]) -> set[tuple[int, int]]:
    return {(row + i, col + j) for row, col in cells for i in (-1, 0, 1) for j in (-1, 0, 1)}


def main() -> int:
    """Run and print the worst restart; return 1 if one lost more than it may."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    restarts = list[Restart]()
    try:
        with tempfile.TemporaryDirectory() as folder:
            for restart in crashes(arguments.kills, arguments.seed, Path(folder)):
                restarts.append(restart)
                print(f"{len(restarts)}: {restart}", flush=True)
    finally:  # an hour's figures survive Ctrl-C and a restart that failed
        print(figures(restarts))
    return int(not all(is_good(each) for each in restarts))


def figures(restarts: list[Restart]) -> str:
    """Return the worst and the median of each cost in one line."""
    if not restarts:
        return "no restart"
    lost_s, errors_m, errors_rad, kept = np.array(
        [(each.lost_s, each.error_m, each.error_rad, each.kept) for each in restarts]
    ).T
    return (
        f"{len(restarts)} kills: {max(lost_s):.1f} s lost at most (median {np.median(lost_s):.1f}), "
        f"pose within {max(errors_m):.3f} m and {math.degrees(max(errors_rad)):.1f} deg "
        f"(median {np.median(errors_m):.3f} m), at least {min(kept):.1%} of the walls kept"
    )


def is_good(restart: Restart) -> bool:
    """Return whether a restart lost no more than it may."""
    return restart.lost_s <= LONGEST_LOSS_S and restart.error_m < 0.15 and restart.kept > 0.9


if __name__ == "__main__":
    sys.exit(main())
