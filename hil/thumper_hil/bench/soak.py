"""Soak test: run a robot for hours with random goals and a random fault in every second drive.

    make soak

The test runs the robot's own service loop with the real firmware, on the bus. For each goal a client
connects, sends it and disconnects. After a fault the robot must stop; then the fault is removed, and clearing
it and sending the next goal must work. A drive without a fault, or with a tolerated one, must reach its goal,
because all goals are free. There must be no contact, no exception and no memory growth.
"""

import argparse
import math
import socket
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from threading import Event
from typing import Any

import numpy as np

from thumper.bus.client import BusClient
from thumper.bus.serve_robot import on_bus
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.bus import BusOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.ros import services
from thumper.ros.services import SendMission
from thumper.runtime.assembly import open_robot
from thumper.runtime.loop import RobotLoop
from thumper.runtime.service.stall_guard import STALE_PERIOD_S, STALE_REQUEST
from thumper_hil.bench import simulation
from thumper_hil.bench.soak_drive import SoakDriver, sleeps_advance
from thumper_hil.bench.soak_report import SoakReport
from thumper_hil.effects.preset import PRESETS

START = Pose2(x_m=1.0, y_m=0.0, theta_rad=math.pi)
GOALS_M = ((1.0, 0.0), (-0.4, 0.2), (0.4, -0.9), (0.9, 1.0), (1.9, 0.4), (2.2, -0.6), (0.0, 0.9))
MAX_GROWTH_MB = 25.0


def soak(duration_s: float, seed: int = 1, preset: str = "nominal") -> SoakReport:
    """Run for `duration_s` simulated seconds or until Ctrl-C; failures are recorded and the run continues."""
    rng, report = np.random.default_rng(seed), SoakReport()
    url = f"sim://soak{seed}"
    board = f"{url}/board?world=lab&seed={seed}&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180&preset={preset}"
    config = with_ports(RobotConfig(), board=board, lidar=f"{url}/lidar")
    bus = BusOptions(address=f"127.0.0.1:{_free_port()}")
    with open_robot(config, START) as robot, on_bus(robot, config.name, bus):
        bench = simulation(f"soak{seed}")
        driver = SoakDriver(robot, bench, rng, report)
        robot.inputs.keep_log = False
        robot.wait_for_map()
        with sleeps_advance(bench), ThreadPoolExecutor(1) as clients, suppress(KeyboardInterrupt):
            while bench.time_s < duration_s:
                goal_m = GOALS_M[rng.integers(len(GOALS_M))]
                bench.fault("battery.charge", 1.0)
                try:
                    _send_goal(robot, clients, (config.name, bus.address), goal_m)
                except ThumperError as error:
                    report.failures.append(f"goal {goal_m} rejected after drive {report.drives}: {error}")
                    robot.cycle()
                else:
                    driver.drive()
        report.simulated_s, report.contacts = bench.time_s, bench.contacts
    if report.growth_MB > MAX_GROWTH_MB:
        report.failures.append(f"memory grew by {report.growth_MB:.1f} MB")
    if report.contacts:
        report.failures.append(f"{report.contacts} contacts")
    return report


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
