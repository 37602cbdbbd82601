"""Time one lidar turn of ray casting, and contact, on the lab world: `python benchmarks/raycast.py`."""

import math
import time
from collections.abc import Callable

import numpy as np

from thumper.geometry import Pose2
from thumper_hil.parts.world import World

BEAMS, REPEATS = 682, 500


def median_us(action: Callable[[], object]) -> float:
    """Median time of one call [us], after one call to compile or load the kernel."""
    action()
    times_s = []
    for _ in range(REPEATS):
        start_s = time.perf_counter()
        action()
        times_s.append(time.perf_counter() - start_s)
    return 1e6 * float(np.median(times_s))


def main() -> None:
    world = World.load("lab_box")
    angles_rad = (np.arange(BEAMS) - 340) * math.tau / 1024
    x_m, y_m = np.linspace(0.0, 0.05, BEAMS), np.linspace(0.0, 0.02, BEAMS)
    footprint_m = np.array([[0.21, 0.1225], [-0.21, 0.1225], [-0.21, -0.1225], [0.21, -0.1225]])
    shapes = f"{len(world.segments_m)} segments, {len(world.circles_m)} circles"
    print(f"lab_box: {shapes}")
    print(
        f"cast, {BEAMS} beams, one origin each: {median_us(lambda: world.cast(x_m, y_m, angles_rad)):.0f} us"
    )
    print(f"clearance of the footprint: {median_us(lambda: world.clearance_m(Pose2(), footprint_m)):.0f} us")


if __name__ == "__main__":
    main()
