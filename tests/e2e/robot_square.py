"""How far from its start does a square of `forward` and `turn` end?

Run: .venv/bin/python -m tests.e2e.robot_square [--world lab] [--seeds 16] [--preset hard]
"""

import argparse
import math

from thumper import Robot
from thumper_hil.bench import simulation

SIDE_M = 0.6
LIMIT_M, LIMIT_DEG = 0.03, 2.0


def square(world: str, seed: int, preset: str = "nominal") -> tuple[float, float]:
    """Drive the square; return how far from the start pose it ended in truth, in metres and degrees."""
    url = f"sim://square{seed}"
    board = f"{url}/board?world={world}&seed={seed}&preset={preset}"
    with Robot(board, lidar=f"{url}/lidar") as robot:
        bench = simulation(f"square{seed}")
        start = bench.truth()[-1]
        for _ in range(4):
            for result in (robot.forward(SIDE_M), robot.turn(deg=90)):
                assert result.reached, result.reason
        end = bench.truth()[-1]
    turned_rad = math.remainder(end[3] - start[3], math.tau)
    return math.hypot(end[1] - start[1], end[2] - start[2]), abs(math.degrees(turned_rad))


def main() -> None:
    """Print each square and how many were within the limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="hall")
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--preset", default="nominal")
    given = parser.parse_args()
    ends = []
    for seed in range(1, given.seeds + 1):
        ends.append(square(given.world, seed, given.preset))
        print(f"seed {seed}: {100.0 * ends[-1][0]:.1f} cm, {ends[-1][1]:.1f} degrees", flush=True)
    good = sum(off_m < LIMIT_M and off_deg < LIMIT_DEG for off_m, off_deg in ends)
    mean_cm = 100.0 * sum(off_m for off_m, _ in ends) / len(ends)
    print(f"{good} of {len(ends)} within 3 cm and 2 degrees; mean {mean_cm:.1f} cm")


if __name__ == "__main__":
    main()
