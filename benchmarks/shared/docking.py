"""Docks from random places of the laboratory: where the robot ends, compared with the dock.

Run: python benchmarks/shared/docking.py [--docks 100] [--seed 1] [--preset nominal]

Each dock is a new robot with the real firmware, a new camera with its own calibration errors and a new place.
It localizes in the world's map and knows the place `dock`. A dock counts if the robot reports it and its true
pose is within 10 mm and 1 degree.
"""

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from thumper.camera.options import CameraOptions
from thumper.common.geometry import Pose2, wrap_angle
from thumper.config.robot import RobotConfig, with_ports
from thumper.maps.annotations import Annotations, SavedPlace
from thumper.runtime.assembly import open_robot
from thumper_hil.bench import simulation
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.registry import forget_simulation
from thumper_hil.world.world import World

WORLD = "charging"
CLEARANCE_M = 0.12  # of a start
LIMIT_M, LIMIT_DEG = 0.010, 1.0


class Docked(NamedTuple):
    """How a dock ended; the errors are the true ones, in the frame of the docked pose."""

    start: Pose2
    reached: bool
    reason: str
    along_m: float
    beside_m: float
    turn_deg: float
    time_s: float
    contacts: int

    @property
    def is_good(self) -> bool:
        """Whether the robot is where it should be."""
        offset_m = math.hypot(self.along_m, self.beside_m)
        return self.reached and offset_m <= LIMIT_M and abs(self.turn_deg) <= LIMIT_DEG

    @property
    def text(self) -> str:
        """Start, errors and reason in one line."""
        start, yaw_deg = self.start, math.degrees(self.start.theta_rad)
        return (
            f"{'ok ' if self.is_good else 'BAD'} from ({start.x_m:+.2f}, {start.y_m:+.2f}, {yaw_deg:+4.0f}): "
            f"{1e3 * self.along_m:+5.1f} mm along {1e3 * self.beside_m:+5.1f} mm beside "
            f"{self.turn_deg:+5.2f} degrees, {self.time_s:.0f} s, {self.contacts} contacts: {self.reason}"
        )


def docked_pose(world: World, config: RobotConfig) -> Pose2:
    """Return the true pose of the docked robot."""
    (tag,) = world.tags
    at = Pose2(x_m=tag.x_m, y_m=tag.y_m, theta_rad=math.radians(tag.yaw_deg))
    return at @ config.dock.tag_from_docked


def free_places(world: World, seed: int) -> Iterator[Pose2]:
    """Yield random poses at which the robot has room to turn."""
    rng = np.random.default_rng(seed)
    x_lo, y_lo, x_hi, y_hi = world.bounds_m()
    while True:
        pose = Pose2(
            x_m=float(rng.uniform(x_lo, x_hi)),
            y_m=float(rng.uniform(y_lo, y_hi)),
            theta_rad=float(rng.uniform(-math.pi, math.pi)),
        )
        body_m = FOOTPRINT_M * (1.0 + CLEARANCE_M / 0.15)
        is_inside = world.cast(pose.x_m, pose.y_m, np.linspace(-math.pi, math.pi, 32)).max() < 10.0
        if is_inside and world.clearance_m(pose, body_m) > 0.0:
            yield pose


def dock(start: Pose2, seed: int, *, preset: str = "nominal", options: str = "") -> Docked:
    """Simulate one dock."""
    name = f"dock-{seed}"
    url = (
        f"sim://{name}/board?world={WORLD}&x_m={start.x_m:.4f}&y_m={start.y_m:.4f}"
        f"&yaw_deg={math.degrees(start.theta_rad):.3f}&seed={seed}&preset={preset}{options}"
    )
    config = RobotConfig(camera=CameraOptions(enabled=True))
    config = with_ports(config, board=url, lidar=f"sim://{name}/lidar")
    world = World.load(WORLD)
    place = docked_pose(world, config)
    saved = SavedPlace(name="dock", x_m=place.x_m, y_m=place.y_m, yaw_rad=place.theta_rad)
    try:
        with open_robot(config, start, world.to_grid(), annotations=Annotations(places=(saved,))) as robot:
            assert robot.request_handler.docking is not None
            result = robot.run(robot.request_handler.docking.dock())
            bench = simulation(name)
            _, x_m, y_m, theta_rad = bench.truth()[-1, :4].tolist()
            at = place.inverse() @ Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
            return Docked(
                start=start,
                reached=result.reached,
                reason=result.reason,
                along_m=at.x_m,
                beside_m=at.y_m,
                turn_deg=math.degrees(wrap_angle(at.theta_rad)),
                time_s=result.time_s,
                contacts=bench.contacts,
            )
    finally:
        forget_simulation(name)


def main() -> int:
    """Print each dock and the figures of all; return 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--docks", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1, help="of the places; robots count from it")
    parser.add_argument("--preset", default="nominal")
    arguments = parser.parse_args()
    places = free_places(World.load(WORLD), arguments.seed)
    found = []
    for number, start in zip(range(arguments.docks), places, strict=False):
        began_s = time.perf_counter()
        one = dock(start, arguments.seed + number, preset=arguments.preset)
        found.append(one)
        print(f"{number + 1:3d} {one.text}, {time.perf_counter() - began_s:.0f} s real", flush=True)
    good = sum(one.is_good for one in found)
    offsets_mm = [1e3 * math.hypot(one.along_m, one.beside_m) for one in found]
    turns_deg = [abs(one.turn_deg) for one in found]
    print(
        f"{good} of {len(found)} docked within {1e3 * LIMIT_M:.0f} mm and {LIMIT_DEG:.0f} degree; "
        f"largest error {max(offsets_mm):.1f} mm, {max(turns_deg):.2f} degrees; "
        f"mean {np.mean(offsets_mm):.1f} mm, {np.mean(turns_deg):.2f} degrees; "
        f"{np.mean([one.time_s for one in found]):.0f} s each"
    )
    return 0 if good == len(found) else 1


if __name__ == "__main__":
    sys.exit(main())
