"""A robot opened with `preset=hard` differs from its parameters by what the preset says, for two seeds."""

import math
from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.common.geometry import FloatArray
from thumper.common.kinematics import WheelSpeeds
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper.lidar.scan import Scan
from thumper_hil.bench import simulation
from thumper_hil.bench.hardware import BASE_FROM_LASER
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.effects.clock_drift import clock_drifts
from thumper_hil.effects.mounting import Mounting, true_mounting
from thumper_hil.effects.pitch import SPRINGS
from thumper_hil.effects.preset import Preset, load_preset
from thumper_hil.effects.tyres import rolling_radius_m

HARD, PARAMS = load_preset("hard"), RobotParams.load()
STATIONARY_S, DRIVE_S, STOP_S = 1.5, 2.5, 0.7
ROBOT = "world=hall&x_m=-5&lidar=ld19"
HALF_WIDTH_M = 3.0  # of the hall


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What the host received while the robot was stationary, drove straight ahead and stopped."""

    seed: int
    telemetry: FloatArray  # arrival [s], stamp [s], counts left and right
    scans: list[Scan]
    truth: FloatArray
    stop_s: float

    @property
    def mounting(self) -> Mounting:
        """The true mounting of the lidar."""
        return true_mounting(BASE_FROM_LASER, HARD.mount, self.seed)


def without_computing(name: str) -> Preset:
    """Return the preset with a host that computes in no time, so that each run is the same."""
    preset = load_preset(name)
    return replace(preset, host=replace(preset.host, cpu_factor=0.0))


def scans_of(name: str, options: str) -> list[Scan]:
    """Return the scans of a stationary robot."""
    lidar = open_lidar(LidarOptions(port=f"sim://{name}/lidar?{ROBOT}&{options}", model="ld19"))
    scans = [lidar.wait_for_sample(1.0) for _ in range(10)]
    lidar.close()
    return scans


def wall_yaw_rad(scans: list[Scan]) -> float:
    """Return by how much the lidar is turned against the long walls of the hall."""
    yaws_rad = []
    for scan in scans:
        x_m, y_m = scan.ranges_m * (np.cos(scan.angles_rad()), np.sin(scan.angles_rad()))
        for side_m in (HALF_WIDTH_M, -HALF_WIDTH_M):
            wall = (np.abs(x_m) < 1.5) & (np.abs(y_m - side_m) < 0.3)
            yaws_rad.append(-math.atan(np.polyfit(x_m[wall], y_m[wall], 1)[0]))
    return float(np.mean(yaws_rad))


@pytest.fixture(scope="module", params=[1, 17])
def run(request: pytest.FixtureRequest) -> Run:
    """Drive in the hall; the two robots have drift, yaw and tilt of opposite signs."""
    name, url = f"hard-{request.param}", f"{ROBOT}&preset=hard&seed={request.param}"
    with patch("thumper_hil.bench.bench.load_preset", without_computing):
        board = Board.open(f"sim://{name}/board?{url}", baud=500_000)
    lidar = open_lidar(LidarOptions(port=f"sim://{name}/lidar", model="ld19"))
    bench, rows, scans = simulation(name), [], []

    def listen(until_s: float, speed_rad_s: float = 0.0) -> None:
        while bench.time_s < until_s:
            if speed_rad_s:
                board.set_wheel_speeds(WheelSpeeds(left_rad_s=speed_rad_s, right_rad_s=speed_rad_s))
            for sample in board.poll(0.5):
                told = sample.telemetry
                rows.append((bench.time_s, 1e-6 * told.time_us, told.left_count, told.right_count))
            scans.extend(lidar.poll())

    board.poll(0.5)  # what came while the lidar started
    listen(bench.time_s + STATIONARY_S)
    board.command(Command.ARM)
    listen(bench.time_s + DRIVE_S, speed_rad_s=9.0)
    stop_s = bench.time_s
    board.emergency_stop()
    listen(stop_s + STOP_S)
    truth = bench.truth()
    lidar.close()
    board.close()
    return Run(seed=request.param, telemetry=np.array(rows), scans=scans, truth=truth, stop_s=stop_s)


def test_the_counts_overstate_the_distance(run: Run) -> None:
    turned_rad = math.tau * np.ptp(run.telemetry[:, 2:], axis=0).mean() / PARAMS.encoder.counts_per_rev
    driven_m = np.hypot(*np.diff(run.truth[:, 1:3], axis=0).T).sum()
    radius_m = rolling_radius_m(PARAMS.body.wheel_radius_m, HARD.body, run.seed)
    assert driven_m / turned_rad == pytest.approx(radius_m, rel=0.01)


def test_the_stamps_of_the_board_drift(run: Run) -> None:
    rate = np.polyfit(run.telemetry[:, 0], run.telemetry[:, 1], 1)[0]
    assert rate - 1.0 == pytest.approx(clock_drifts(HARD.clock, run.seed)[0], abs=0.0025)


def test_telemetry_arrives_late(run: Run) -> None:
    sent_s = run.telemetry[:, 1] / (1.0 + clock_drifts(HARD.clock, run.seed)[0])
    late_s = run.telemetry[:, 0] - sent_s
    expected_s = HARD.host.wake_up_s + 0.5 * HARD.host.usb_latency_s
    assert np.mean(late_s - late_s.min()) == pytest.approx(expected_s, abs=0.003)


def test_the_walls_appear_turned_by_the_bracket(run: Run) -> None:
    """Against the same lidar, with its own errors, on a bracket that is right."""
    turned_rad = wall_yaw_rad(run.scans[: int(10 * STATIONARY_S)])
    turned_rad -= wall_yaw_rad(scans_of(f"nominal-{run.seed}", f"preset=nominal&seed={run.seed}"))
    expected_rad = run.mounting.base_from_laser.theta_rad
    assert math.degrees(turned_rad) == pytest.approx(math.degrees(expected_rad), abs=0.25)


def test_a_stop_pitches_the_lidar_to_the_floor(run: Run) -> None:
    nearest_m = np.inf
    for scan in run.scans:
        if scan.time_s > run.stop_s:
            ahead = np.cos(scan.angles_rad()) > 0.99
            nearest_m = min(nearest_m, float(np.nanmedian(scan.ranges_m[ahead])))
    pitch_rad = math.atan(SPRINGS.lidar_height_m / nearest_m) - run.mounting.tilt_rad
    speed_m_s = PARAMS.body.wheel_radius_m * run.truth[:, 4:].mean(axis=1)
    braking_m_s2 = np.max(speed_m_s[:-10] - speed_m_s[10:]) / 0.1  # the truth has 100 rows per second
    ratio = math.degrees(pitch_rad) / (HARD.body.pitch_deg_per_m_s2 * braking_m_s2)
    assert 0.7 < ratio < 1.7  # the springs overshoot by 1.4; the robot shakes, and scans come at 10 Hz
