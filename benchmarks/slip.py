"""How many slips of the wheels are counted beside a gyroscope, and how often none was there.

Run: python benchmarks/slip.py [--drives N] [--hours H]
Simulated drives in curves at 0.4 m/s, 50 readings of the wheels a second; the wheels' noise is that of
`OdometryOptions`, the gyroscope's that of `ImuOptions`.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from tests.host.odometry.drives import driven

RATES_RAD_S = (0.3, 0.5, 0.75, 1.0, 1.5, 2.0)
LENGTHS_S = (0.2, 0.5, 1.0)


def main() -> None:
    """Print the share of the slips that are counted, by how fast they turn and how long they last."""
    parser = argparse.ArgumentParser(description="slips seen by wheels and gyroscope")
    parser.add_argument("--drives", type=int, default=100, help="for each rate and length")
    parser.add_argument("--hours", type=float, default=1.0, help="of driving without a slip")
    arguments = parser.parse_args()
    for slip_s in LENGTHS_S:
        shares = []
        for rate in RATES_RAD_S:
            runs = (
                driven(seed, 8.5 + slip_s, slip_rad_s=rate, slip_s=slip_s) for seed in range(arguments.drives)
            )
            seen = sum(fused.slips > 0 for _, fused, _ in runs)
            shares.append(f"{100.0 * seen / arguments.drives:.0f}")
        rates = ", ".join(f"{rate:g}" for rate in RATES_RAD_S)
        figure(f"slips of {slip_s:g} s that are counted, at {rates} rad/s", " / ".join(shares), "%")
    _, fused, _ = driven(1, 3600.0 * arguments.hours)
    figure(f"false alarms in {arguments.hours:g} h", str(fused.slips))


if __name__ == "__main__":
    main()
