"""Time the ray casting of one lidar revolution, and the contact check, in the lab and in large maps."""

import math
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from thumper.common.geometry import Pose2
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.world.occupancy import SolidGrid
from thumper_hil.world.world import World

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

BEAMS, REPEATS = 682, 500


def median_us(action: Callable[[], object]) -> float:
    """Return the median time of one call [us], after one call that compiles or loads the kernel."""
    action()
    times_s = []
    for _ in range(REPEATS):
        start_s = time.perf_counter()
        action()
        times_s.append(time.perf_counter() - start_s)
    return 1e6 * float(np.median(times_s))


def main() -> None:
    """Print the times."""
    world = World.load("lab_box")
    angles_rad = (np.arange(BEAMS) - 340) * math.tau / 1024
    x_m, y_m = np.linspace(0.0, 0.05, BEAMS), np.linspace(0.0, 0.02, BEAMS)
    shapes = f"{len(world.segments_m)} segments, {len(world.circles_m)} circles"
    print(f"lab_box: {shapes}")
    scan_us = median_us(lambda: world.cast(x_m, y_m, angles_rad))
    figure(f"simulated lidar: one scan of {BEAMS} beams in the lab", f"{scan_us:.0f}", "us")
    clear_us = median_us(lambda: world.clearance_m(Pose2(), FOOTPRINT_M))
    figure("simulator: clearance of the footprint", f"{clear_us:.0f}", "us")
    for share in (0.0, 0.001, 0.01):
        large = random_map(share)
        cast_us = median_us(partial(large.cast, 0.0, 0.0, angles_rad))
        clearance_us = median_us(partial(large.clearance_m, Pose2(), FOOTPRINT_M))
        figure(
            f"scan / clearance in 1000 x 1000 cells, {share:.1%} solid",
            f"{cast_us:.0f} / {clearance_us:.0f}",
            "us",
        )


def random_map(share: float) -> World:
    """Return a map of 50 x 50 m whose cells, except the centre, are solid with this probability."""
    solid = np.random.default_rng(1).random((1000, 1000)) < share
    solid[500, 500] = False
    grid = SolidGrid(solid=solid, resolution_m=0.05, x_lo_m=-25.025, y_lo_m=-25.025)
    return World(segments_m=np.zeros((0, 4)), circles_m=np.zeros((0, 3)), grid=grid)


if __name__ == "__main__":
    main()
