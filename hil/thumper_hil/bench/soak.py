"""Soak: a robot at service for hours, with random goals, and a random fault in every second drive.

    make soak

It is the product's own service loop on the real firmware, on the bus: for each goal a client joins, sends it
and leaves. After each fault the robot must come to a stand, the fault is mended, and the way back (clear,
send again) must be open. A drive without a fault, or with one that it is to drive on through, must reach its
goal: all goals are free. Nothing may be touched, nothing may be raised, and memory must not grow.
"""

import argparse
import math
import socket
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any
from unittest.mock import patch

import numpy as np

from thumper.board.messages import State
from thumper.bus.client import BusClient
from thumper.bus.serve_robot import on_bus
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.bus import BusOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.drive_manager import DriveMode
from thumper.runtime.drive.waypoints import MissionState
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import EmergencyStop, RobotCommand
from thumper.runtime.sensor_inputs import BLIND_S
from thumper.runtime.service.stall_guard import STALE_PERIOD_S, STALE_REQUEST
from thumper_hil.bench import Bench, simulation

START = Pose2(x_m=1.0, y_m=0.0, theta_rad=math.pi)
PLACES_M = ((1.0, 0.0), (-0.4, 0.2), (0.4, -0.9), (0.9, 1.0), (1.9, 0.4), (2.2, -0.6), (0.0, 0.9))
MOST_BEATS = 900  # of one drive
STANDING_RAD_S = 0.1
LIDAR_BACK_S = 10.0  # from a plug put back to the next scan: its port is opened anew
STOP_S = 4.0  # a wheel at a low set-point takes 1.7 s to be noticed, and then coasts
MOST_GROWTH_MB = 25.0
FEWEST_IN_TENTH = 10  # before, kernels are still compiled and loaded as they are first needed
E_STOP = "e-stop"
# What breaks, how, and what mends it; None mends itself.
FAULTS: tuple[tuple[str, str | float, str | float | None], ...] = (
    ("encoder.left.a", "cut", "ok"),
    ("encoder.right.b", "cut", "ok"),
    ("motor.left", "dead", "ok"),
    ("motor.right", "swapped", "ok"),
    ("wheels.left", "blocked", "ok"),
    ("firmware", "hang", None),
    ("firmware", "loop", None),
    ("firmware", "reset", None),
    ("board", "unplugged", "ok"),
    ("lidar", "unplugged", "ok"),
    ("host.hang", 0.6, None),
    (E_STOP, "", None),
    # The robot is to drive on through these:
    ("line.noise", 2e-5, 0.0),
    ("encoder.left.glitches", 2000.0, 0.0),
    ("slip.right", 0.2, 0.0),
)
DRIVES_ON = {"line.noise", "encoder.left.glitches", "slip.right"}


@dataclass(slots=True, kw_only=True)
class Report:
    """What came of it."""

    simulated_s: float = 0.0
    drives: int = 0
    reached: int = 0
    owed: int = 0  # drives without a fault that stops the robot: each must reach its goal
    owed_reached: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    longest_stop_s: float = 0.0  # from a fault to standing wheels
    contacts: int = 0
    memory_MB: list[float] = field(default_factory=list)  # resident, once a drive
    complaints: list[str] = field(default_factory=list)  # what must not have been

    @property
    def growth_MB(self) -> float:
        """Memory of the last tenth of the drives over that of the second tenth; 0 where they are too few."""
        tenth = len(self.memory_MB) // 10
        if tenth < FEWEST_IN_TENTH:
            return 0.0
        early, late = self.memory_MB[tenth : 2 * tenth], self.memory_MB[-tenth:]
        return float(np.median(late) - np.median(early))


def soak(duration_s: float, seed: int = 1) -> Report:
    """Run for so many simulated seconds, or until Ctrl-C.

    What must not be is noted, and the next drive follows.
    """
    rng, report = np.random.default_rng(seed), Report()
    url = f"sim://soak{seed}"
    board = f"{url}/board?world=lab&seed={seed}&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = with_ports(RobotConfig(), board=board, lidar=f"{url}/lidar")
    bus = BusOptions(address=f"127.0.0.1:{_free_port()}")
    with open_robot(config, START) as robot, on_bus(robot, config.name, bus):
        bench = simulation(f"soak{seed}")
        robot.request_handler.accepts_goals, robot.inputs.keep_log = True, False
        robot.inputs.wait_for_map(lambda: robot.step()[0])
        with (
            _time_passes_in_naps(bench),
            ThreadPoolExecutor(1) as visitors,
            suppress(KeyboardInterrupt),
        ):
            while bench.time_s < duration_s:
                place_m = PLACES_M[rng.integers(len(PLACES_M))]
                bench.fault("battery.charge", 1.0)
                try:
                    _send_goal(robot, visitors, (config.name, bus.address), place_m)
                except ThumperError as error:
                    report.complaints.append(f"after drive {report.drives}, goal {place_m} refused: {error}")
                    robot.serve_step()
                else:
                    _one_drive(robot, bench, rng, report)
        report.simulated_s, report.contacts = bench.time_s, bench.contacts
    if report.growth_MB > MOST_GROWTH_MB:
        report.complaints.append(f"memory grew by {report.growth_MB:.1f} MB")
    if report.contacts:
        report.complaints.append(f"{report.contacts} contacts")
    return report


def _send_goal(
    robot: RobotLoop, visitors: ThreadPoolExecutor, bus: tuple[str, str], place_m: tuple[float, float]
) -> None:
    """Have a new client join, send the goal and leave. No simulated time passes: a seed gives one run.

    Raises
    ------
    ThumperError
        The robot does not answer, or refuses a goal that is free.
    """

    def visit() -> None:
        with BusClient(*bus) as client:
            client.query("mission/send", {"x_m": place_m[0], "y_m": place_m[1]})

    while True:
        visitor = visitors.submit(visit)
        _attend_until_done(robot, visitor)
        try:
            return visitor.result()
        except ThumperError as error:
            if (
                str(error) != STALE_REQUEST
            ):  # this computer is so busy that the loop looked hung: ask again, as told
                raise
        _attend_until_done(robot, visitors.submit(Event().wait, STALE_PERIOD_S))


def _attend_until_done(robot: RobotLoop, visitor: Future[Any]) -> None:
    while not visitor.done():
        robot.request_handler.process_pending()
        wait([visitor], timeout=0.005)


def _one_drive(robot: RobotLoop, bench: Bench, rng: np.random.Generator, report: Report) -> None:
    report.drives += 1
    name, bad, good = FAULTS[rng.integers(len(FAULTS))]
    at_beat = int(rng.integers(5, 40)) if report.drives % 2 == 0 else -1
    broken = ""
    for beat in range(MOST_BEATS):
        robot.serve_step()
        if robot.drive_manager.mode is DriveMode.IDLE:
            break
        if beat == at_beat and robot.drive_manager.mode is DriveMode.DRIVING:
            broken = name
            report.faults[name] += 1
            _break(robot, bench, name, bad)
            if name not in DRIVES_ON:
                _must_stop(robot, bench, name, report)
                break
    mission = robot.request_handler.missions.newest
    assert mission is not None  # one was sent
    reached = mission.state is MissionState.REACHED
    report.reached += reached
    if not broken or broken in DRIVES_ON:
        report.owed += 1
        report.owed_reached += reached
        if not reached:
            x_m, y_m = mission.goals[0].x_m, mission.goals[0].y_m
            report.complaints.append(
                f"drive {report.drives} to ({x_m}, {y_m}), {broken or 'no fault'}, is {mission.state.value}: "
                f"{mission.reason or robot.drive_manager.reason}"
            )
    if broken and good is not None:
        bench.fault(broken, good)
    _way_back(robot, bench, report, broken or "no fault")
    bench.clear_truth()
    report.memory_MB.append(_resident_MB())


def _break(robot: RobotLoop, bench: Bench, name: str, bad: str | float) -> None:
    if name == E_STOP:
        robot.request_queue.put(EmergencyStop())
    else:
        bench.fault(name, bad)


def _must_stop(robot: RobotLoop, bench: Bench, name: str, report: Report) -> None:
    broke_s = bench.time_s
    while bench.time_s < broke_s + STOP_S or robot.drive_manager.mode is DriveMode.DRIVING:
        robot.serve_step()
        if bench.time_s > broke_s + 3.0 * STOP_S:
            break
    truth = bench.truth()[-round(100 * (bench.time_s - broke_s)) :]
    moving_s = truth[(np.abs(truth[:, 4:6]) > STANDING_RAD_S).any(axis=1), 0]
    stop_s = float(moving_s[-1] - broke_s) if moving_s.size else 0.0
    report.longest_stop_s = max(report.longest_stop_s, stop_s)
    if stop_s > STOP_S or robot.drive_manager.mode is DriveMode.DRIVING:
        report.complaints.append(
            f"{name}: the robot stood after {stop_s:.1f} s, then {robot.drive_manager.reason}"
        )


def _way_back(robot: RobotLoop, bench: Bench, report: Report, after: str) -> None:
    """Wait for the lidar and clear what is latched, as the operator would; the next drive shows whether the
    way is open.
    """
    for _ in range(15):
        robot.serve_step()
    back_s = bench.time_s + LIDAR_BACK_S
    while not _sees(robot) and bench.time_s < back_s:
        robot.serve_step()
    if not _sees(robot):
        report.complaints.append(f"after {after} there are no scans for {LIDAR_BACK_S:.0f} s")
    telemetry = robot.inputs.telemetry
    if telemetry is not None and telemetry.state is State.FAULT:
        robot.request_queue.put(RobotCommand(name="clear_fault"))
        for _ in range(5):
            robot.serve_step()
    telemetry = robot.inputs.telemetry
    if telemetry is None or telemetry.state is not State.DISARMED:
        state = telemetry.state.name if telemetry else "silent"
        report.complaints.append(f"after {after} the board is {state}: {robot.drive_manager.reason}")


def _sees(robot: RobotLoop) -> bool:
    situation = robot.inputs.estimator.state()
    return situation is not None and situation.scan_age_s < BLIND_S


@contextmanager
def _time_passes_in_naps(bench: Bench) -> Iterator[None]:
    """The loop naps while it looks for a lost board: simulated time passes then, and the board comes back."""
    naps = 0

    def nap(duration_s: float) -> None:
        nonlocal naps
        naps += 1
        bench.advance(bench.time_s + duration_s)
        if naps % 3 == 0:
            bench.fault("board", "ok")

    with patch("thumper.runtime.loop.time.sleep", nap):
        yield


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def _resident_MB() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


def main() -> int:
    """Print what came of it; 1 when something was not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--hours", type=float, default=2.0, help="of simulated time")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    begun_s = time.perf_counter()
    report = soak(3600.0 * arguments.hours, arguments.seed)
    if not report.drives:
        print("no drive was ended")
        return 1
    wall_s = time.perf_counter() - begun_s
    hours, minutes = report.simulated_s / 3600.0, wall_s / 60.0
    print(f"{hours:.2f} simulated hours in {minutes:.1f} min: {report.drives} drives")
    print(
        f"goals reached: {report.owed_reached} of the {report.owed} drives that no fault was to stop, "
        f"{report.reached - report.owed_reached} of the others"
    )
    print(
        f"{sum(report.faults.values())} faults, longest stop {report.longest_stop_s:.2f} s, "
        f"{report.contacts} contacts"
    )
    print(
        f"memory {report.memory_MB[0]:.0f} MB after the first drive, {report.memory_MB[-1]:.0f} MB after the "
        f"last; last tenth over second tenth {report.growth_MB:+.1f} MB"
    )
    print(", ".join(f"{name} {count}" for name, count in sorted(report.faults.items())))
    for complaint in report.complaints:
        print(f"NOT AS IT MUST BE: {complaint}")
    return 1 if report.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
