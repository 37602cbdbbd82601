"""One drive of a soak run: drive, inject a fault, check the stop, recover."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np

from thumper.board.messages import State
from thumper.runtime.drive.drive_manager import DriveMode
from thumper.runtime.drive.waypoints import MissionState
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import EmergencyStop, RobotCommand
from thumper.runtime.sensor_inputs import BLIND_S
from thumper_hil.bench import Bench
from thumper_hil.bench.soak_report import SoakReport, Usage

MAX_CYCLES = 900  # per drive
STATIONARY_RAD_S = 0.1
LIDAR_RECOVERY_S = 10.0  # from reconnecting the lidar to the next scan; the robot must reopen the port
STOP_S = 4.0  # a wheel at a low set-point is detected after 1.7 s, then it coasts
E_STOP = "e-stop"
# Name, value that causes the fault, value that clears it (None: the fault ends by itself).
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
    # The robot must drive on with these:
    ("line.noise", 2e-5, 0.0),
    ("encoder.left.glitches", 2000.0, 0.0),
    ("slip.right", 0.2, 0.0),
)
TOLERATED = {"line.noise", "encoder.left.glitches", "slip.right"}
# The tyres hold the robot straight and drag the dead side along, until it has to turn.
MAY_DRIVE_ON = {"motor.left"}


class SoakDriver:
    """Performs the drives of a soak run and records them in `report`."""

    def __init__(self, robot: RobotLoop, bench: Bench, rng: np.random.Generator, report: SoakReport) -> None:
        self._robot, self._bench = robot, bench
        self._rng, self._report = rng, report

    def drive(self) -> None:
        """Finish the mission that was sent, with a random fault in every second drive; then recover."""
        report = self._report
        report.drives += 1
        name, value, cleared = FAULTS[self._rng.integers(len(FAULTS))]
        fault_cycle = int(self._rng.integers(5, 40)) if report.drives % 2 == 0 else -1
        fault = self._run_mission(name, value, fault_cycle)
        self._check_goal(fault)
        if fault and cleared is not None:
            self._bench.fault(fault, cleared)
        self._recover(fault or "no fault")
        self._bench.clear_truth()
        report.usage.append(
            Usage(
                time_s=report.simulated_s + self._bench.time_s,
                memory_MB=_resident_MB(),
                handles=len(list(Path("/proc/self/fd").iterdir())),
                threads=threading.active_count(),
            )
        )

    def _run_mission(self, name: str, value: str | float, fault_cycle: int) -> str:
        """Run until the mission ends; return the fault that was injected, empty for none."""
        fault = ""
        for cycle in range(MAX_CYCLES):
            self._robot.cycle()
            if self._robot.drive_manager.mode is DriveMode.IDLE:
                break
            if cycle == fault_cycle and self._robot.drive_manager.mode is DriveMode.DRIVING:
                fault = name
                self._report.faults[name] += 1
                self._inject(name, value)
                if name not in TOLERATED | MAY_DRIVE_ON:
                    self._check_stop(name)
                    break
        return fault

    def _inject(self, name: str, value: str | float) -> None:
        if name == E_STOP:
            self._robot.request_queue.put(EmergencyStop())
        else:
            self._bench.fault(name, value)

    def _check_goal(self, fault: str) -> None:
        """Count the drive; without a stopping fault it must have reached its goal."""
        report, mission = self._report, self._robot.request_handler.missions.newest
        assert mission is not None  # it was sent before
        reached = mission.state is MissionState.REACHED
        report.reached += reached
        if fault and fault not in TOLERATED:
            return
        report.required += 1
        report.required_reached += reached
        if not reached:
            x_m, y_m = mission.legs[0].goal.x_m, mission.legs[0].goal.y_m
            report.failures.append(
                f"drive {report.drives} to ({x_m}, {y_m}), {fault or 'no fault'}, is {mission.state.value}: "
                f"{mission.reason or self._robot.drive_manager.reason}"
            )

    def _check_stop(self, name: str) -> None:
        """Run until the robot must have stopped, and check when it did."""
        robot, bench, report = self._robot, self._bench, self._report
        fault_s = bench.time_s
        while bench.time_s < fault_s + STOP_S or robot.drive_manager.mode is DriveMode.DRIVING:
            robot.cycle()
            if bench.time_s > fault_s + 3.0 * STOP_S:
                break
        truth = bench.truth()[-round(100 * (bench.time_s - fault_s)) :]
        moving_s = truth[(np.abs(truth[:, 4:6]) > STATIONARY_RAD_S).any(axis=1), 0]
        stop_s = float(moving_s[-1] - fault_s) if moving_s.size else 0.0
        report.longest_stop_s = max(report.longest_stop_s, stop_s)
        if stop_s > STOP_S or robot.drive_manager.mode is DriveMode.DRIVING:
            report.failures.append(
                f"{name}: the robot stopped after {stop_s:.1f} s, then {robot.drive_manager.reason}"
            )

    def _recover(self, after: str) -> None:
        """Wait for the lidar and clear a latched fault, as an operator would."""
        self._step(15)
        limit_s = self._bench.time_s + LIDAR_RECOVERY_S
        while not self._has_scans() and self._bench.time_s < limit_s:
            self._step(1)
        if not self._has_scans():
            self._report.failures.append(f"no scans for {LIDAR_RECOVERY_S:.0f} s after {after}")
        telemetry = self._robot.inputs.telemetry
        if telemetry is not None and telemetry.state is State.FAULT:
            self._robot.request_queue.put(RobotCommand(name="clear_fault"))
            self._step(5)
        telemetry = self._robot.inputs.telemetry
        if telemetry is None or telemetry.state is not State.DISARMED:
            state = telemetry.state.name if telemetry else "silent"
            reason = self._robot.drive_manager.reason
            self._report.failures.append(f"the board is {state} after {after}: {reason}")

    def _step(self, cycles: int) -> None:
        for _ in range(cycles):
            self._robot.cycle()

    def _has_scans(self) -> bool:
        state = self._robot.inputs.estimator.state()
        return state is not None and state.scan_age_s < BLIND_S


@contextmanager
def sleeps_advance(bench: Bench) -> Iterator[None]:
    """Advance simulated time in the sleeps of a robot that looks for its lost board; reconnect the board."""
    sleeps = 0

    def sleep(duration_s: float) -> None:
        nonlocal sleeps
        sleeps += 1
        bench.advance(bench.time_s + duration_s)
        if sleeps % 3 == 0:
            bench.fault("board", "ok")

    with patch("thumper.runtime.reconnection.time.sleep", sleep):
        yield


def _resident_MB() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6
