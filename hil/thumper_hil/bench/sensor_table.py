"""The simulated sensors beside board and lidar, built when their port opens first."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.optional_packages import require_extra
from thumper_hil.bench.body_trajectory import BodyTrajectory
from thumper_hil.bench.options import BenchOptions
from thumper_hil.bench.sensor_line import SimulatedSensor
from thumper_hil.faults.switches import Switches
from thumper_hil.sensors.bno08x import Bno08x
from thumper_hil.sensors.gnss_receiver import GnssReceiver
from thumper_hil.sensors.ubx_receiver import UbxReceiver
from thumper_hil.world.world import World

WALL_BEARINGS_RAD = np.arange(16) * (math.tau / 16.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What a sensor observes: the robot's motion, the world now, and the faults."""

    options: BenchOptions
    track: BodyTrajectory
    world: Callable[[], World]
    faults: Switches


def _imu(around: Surroundings, power_on_s: float) -> Bno08x:
    return Bno08x(
        pose_at=around.track.pose_at,
        pitch_at=around.track.pitch_at,
        seed=around.options.seed,
        power_on_s=power_on_s,
    )


def _gps(around: Surroundings, power_on_s: float) -> GnssReceiver:
    receiver = UbxReceiver if around.options.gps_protocol == "ubx" else GnssReceiver
    return receiver(
        pose_at=around.track.pose_at,
        wall_m=lambda x_m, y_m: float(np.min(around.world().cast(x_m, y_m, WALL_BEARINGS_RAD))),
        faults=around.faults,
        kind=around.options.gps,
        rate_Hz=around.options.gps_Hz,
        seed=around.options.seed,
        power_on_s=power_on_s,
    )


def _camera(around: Surroundings, power_on_s: float) -> SimulatedSensor:
    require_extra("camera")
    from thumper_hil.sensors.camera import Camera  # needs OpenCV

    return Camera(
        pose_at=around.track.pose_at,
        world=around.world,
        seed=around.options.seed,
        power_on_s=power_on_s,
    )


SENSORS: dict[str, Callable[[Surroundings, float], SimulatedSensor]] = {
    "imu": _imu,
    "gps": _gps,
    "camera": _camera,
}
"""By the name in `sim://NAME/DEVICE`: from what surrounds the sensor, and the time [s] of its power-on."""
