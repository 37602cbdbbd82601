"""Soak test: run a robot for hours with random goals and a random fault in every second drive.

    make soak            two hours
    make soak HOURS=8

The test runs the robot's own service loop with the real firmware, on the bus. For each goal a client
connects, sends it and disconnects. After a fault the robot must stop; then the fault is removed, and clearing
it and sending the next goal must work. A drive without a fault, or with a tolerated one, must reach its goal,
because all goals are free. After some drives the robot is closed and opened again, in the same map. It
records all the time, at its budget. There must be no contact and no exception. Memory, open files and threads
must not grow by more than 5 % after the first hour.
"""

import argparse
import math
import socket
import sys
import tempfile
import time
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np

from thumper.bus.client import BusClient
from thumper.bus.serve_robot import on_bus
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.bus import BusOptions
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.recording.start_stop import recording_control
from thumper.ros import services
from thumper.ros.services import SendMission
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import wait as wait_for
from thumper.runtime.loop import RobotLoop
from thumper.runtime.service.stall_guard import STALE_PERIOD_S, STALE_REQUEST
from thumper.slam.saved_state import SavedSlamState
from thumper_hil.bench import simulation
from thumper_hil.bench.registry import forget_simulation
from thumper_hil.bench.soak_drive import SoakDriver, sleeps_advance
from thumper_hil.bench.soak_report import SoakReport
from thumper_hil.effects.preset import PRESETS

START = Pose2(x_m=1.0, y_m=0.0, theta_rad=math.pi)
GOALS_M = ((1.0, 0.0), (-0.4, 0.2), (0.4, -0.9), (0.9, 1.0), (1.9, 0.4), (2.2, -0.6), (0.0, 0.9))
RESTART_DRIVES = 12  # after so many drives the robot is closed and opened again
FILE_MB, BUDGET_MB = 0.5, 2.0  # of the recording: it reaches its budget within minutes
MAX_GROWTH = 0.05


def soak(duration_s: float, seed: int = 1, preset: str = "nominal") -> SoakReport:
    """Run for `duration_s` simulated seconds or until Ctrl-C; failures are recorded and the run continues."""
    rng, report = np.random.default_rng(seed), SoakReport()
    with tempfile.TemporaryDirectory() as folder, suppress(KeyboardInterrupt):
        place = Place(pose=START, true_pose=START, session=None)
        while report.simulated_s < duration_s:
            name = f"soak{seed}-{report.restarts}"
            url, pose = f"sim://{name}", place.true_pose
            where = f"x_m={pose.x_m}&y_m={pose.y_m}&yaw_deg={math.degrees(pose.theta_rad)}"
            board = f"{url}/board?world=lab&seed={seed}&{where}&preset={preset}"
            config = replace(
                with_ports(RobotConfig(), board=board, lidar=f"{url}/lidar"),
                recording=RecordingOptions(folder=folder, file_MB=FILE_MB, budget_MB=BUDGET_MB, spare_MB=0.0),
            )
            place = _run(config, name, place, rng, report, duration_s)
            forget_simulation(name)
            report.restarts += 1
        report.recorded_MB = sum(path.stat().st_size for path in Path(folder).iterdir()) / 1e6
        _check_usage(report)
    if report.contacts:
        report.failures.append(f"{report.contacts} contacts")
    return report


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a run of the robot begins."""

    pose: Pose2 | None  # in the map, as the robot knows it
    true_pose: Pose2
    session: SavedSlamState | None


def _run(
    config: RobotConfig,
    name: str,
    place: Place,
    rng: np.random.Generator,
    report: SoakReport,
    duration_s: float,
) -> Place:
    """Open the robot, drive for a while and close it; return where and with which map it goes on."""
    bus = BusOptions(address=f"127.0.0.1:{_free_port()}")
    folder = Path(config.recording.folder)
    with (
        open_robot(config, place.pose, place.session) as robot,
        on_bus(robot, config.name, bus),
        recording_control(robot, config, START, folder, report.failures.append) as recording,
    ):
        recording.start()
        bench = simulation(name)
        driver = SoakDriver(robot, bench, rng, report)
        robot.inputs.keep_log = False
        robot.wait_for_map()
        last_drive = report.drives + RESTART_DRIVES
        try:
            with sleeps_advance(bench), ThreadPoolExecutor(1) as clients:
                while report.simulated_s + bench.time_s < duration_s and report.drives < last_drive:
                    goal_m = GOALS_M[rng.integers(len(GOALS_M))]
                    bench.fault("battery.charge", 1.0)
                    try:
                        _send_goal(robot, clients, (config.name, bus.address), goal_m)
                    except ThumperError as error:
                        report.failures.append(f"goal {goal_m} rejected after drive {report.drives}: {error}")
                        robot.cycle()
                    else:
                        driver.drive()
            robot.run(wait_for(1.0))  # at rest, with a scan of this place
        finally:
            report.simulated_s += bench.time_s
            report.contacts += bench.contacts
        state = robot.inputs.estimator.state()
        assert state is not None  # it drove
        _, x_m, y_m, theta_rad = bench.truth()[-1, :4]
        return Place(
            pose=state.map_from_base,
            true_pose=Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad),
            session=SavedSlamState.from_mapper(robot.mapper, state.map_from_base),
        )


def _check_usage(report: SoakReport) -> None:
    for name, growth in report.growth().items():
        if growth > MAX_GROWTH:
            report.failures.append(f"{name} grew by {100.0 * growth:.1f} % after the warm-up")
    if not 0.0 < report.recorded_MB <= BUDGET_MB + FILE_MB:
        report.failures.append(f"{report.recorded_MB:.1f} MB of recordings, the budget is {BUDGET_MB} MB")


def _send_goal(
    robot: RobotLoop, clients: ThreadPoolExecutor, bus: tuple[str, str], goal_m: tuple[float, float]
) -> None:
    """Connect a new client that sends the goal and disconnects, without advancing simulated time.

    Raises
    ------
    ThumperError
        The robot does not answer, or rejects the goal.
    """

    def send() -> None:
        with BusClient(*bus) as client:
            services.MISSION_SEND.call(client, SendMission(x_m=goal_m[0], y_m=goal_m[1]))

    while True:
        client = clients.submit(send)
        _process_until_done(robot, client)
        try:
            return client.result()
        except ThumperError as error:
            if str(error) != STALE_REQUEST:
                raise
        # This computer is so busy that the loop seemed to hang. Send the goal again, as the error asks.
        _process_until_done(robot, clients.submit(Event().wait, STALE_PERIOD_S))


def _process_until_done(robot: RobotLoop, client: Future[Any]) -> None:
    while not client.done():
        robot.request_handler.process_pending()
        wait([client], timeout=0.005)


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def main() -> int:
    """Run and print the report; return 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--hours", type=float, default=2.0, help="duration in simulated hours")
    parser.add_argument("--seed", type=int, default=1, help="seed of goals and faults")
    parser.add_argument("--preset", choices=PRESETS, default="hard", help="how hard the robot is")
    arguments = parser.parse_args()
    start_s = time.perf_counter()
    report = soak(3600.0 * arguments.hours, arguments.seed, arguments.preset)
    if not report.drives:
        print("no drive was completed; run for longer")
        return 1
    print(f"preset {arguments.preset}")
    print("\n".join(report.lines(time.perf_counter() - start_s)))
    return 1 if report.failures else 0


if __name__ == "__main__":
    sys.exit(main())
