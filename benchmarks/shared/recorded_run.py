"""Synthetic messages of a run, the same every time."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from benchmarks.shared.telemetry import telemetry_sample

from thumper.board.board import TelemetrySample
from thumper.common.geometry import Pose2, Twist2
from thumper.config.robot import RobotConfig
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.odometry.wheel_odometry import OdometrySample
from thumper.recording.run_metadata import RunMetadata
from thumper.ros.status import Status
from thumper.ros.to_ros import Messages

EPOCH_NS = 1_750_000_000_123_456_789
RUN = RunMetadata(config=RobotConfig(name="mole"), epoch_ns=EPOCH_NS, map_from_base=Pose2(x_m=1.0))
MESSAGES = Messages(epoch_ns=EPOCH_NS)


def telemetry(time_s: float, count: int) -> TelemetrySample:
    return telemetry_sample(
        time_s,
        left_count=count,
        left_speed=1000,
        left_setpoint=1100,
        left_pwm=70,
        left_integral=-3,
        right_count=count + 1,
        right_speed=1001,
        right_setpoint=1100,
        right_pwm=71,
        right_integral=4,
        battery_mV=7600,
        left_current_mA=300,
        right_current_mA=310,
        rx_frames=count % 65536,
    )


def scan(time_s: float, seed: int = 0) -> Scan:
    ranges_m = np.random.default_rng(seed).uniform(0.3, 5.0, 682)
    ranges_m[::7], ranges_m[3] = np.nan, np.inf
    return Scan(
        time_s=time_s,
        ranges_m=ranges_m,
        angle_min_rad=-2.0862,
        angle_increment_rad=0.0061359,
        time_increment_s=9.765625e-5,
    )


def cycle(k: int) -> Iterator[tuple[str, float, Any]]:
    """Yield the messages of the k-th control cycle."""
    now_s = 5.0 + 0.1 * k
    pose = Pose2(x_m=0.01 * k)
    odometry = OdometrySample(time_s=now_s, odom_from_base=pose, twist=Twist2(), covariance=np.eye(3))
    yield "wheels", now_s, MESSAGES.wheels(telemetry(now_s, 10 * k))
    yield "scan", now_s, MESSAGES.scan(scan(now_s - 0.1, k))
    yield "odom", now_s, MESSAGES.odometry(odometry)
    yield "pose", now_s, MESSAGES.pose(now_s, pose)
    yield "tf", now_s, MESSAGES.transforms(now_s, Pose2(), pose)
    yield "cmd_vel", now_s, MESSAGES.twist(now_s, Twist2(v_m_s=0.3))
    yield (
        "status",
        now_s,
        MESSAGES.status(Status(time_s=now_s, robot="mole", mode="navigating", localization="mapping")),
    )
    if k % 10 == 0:
        cells = np.full((40, 30), -1, dtype=np.int8)
        cells[5:10, 5:10], cells[10] = 0, 100
        grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-1.0, origin_y_m=-0.5)
        yield "map", now_s, MESSAGES.grid(now_s, grid)
        yield "plan", now_s, MESSAGES.path(now_s, np.array([[0.0, 0.0], [1.0, 0.5]]))


def cycles(count: int) -> Iterator[tuple[str, float, Any]]:
    for k in range(count):
        yield from cycle(k)
