"""Slip detection with wheels and gyroscope: detection rate and false alarms.

Run: python benchmarks/slip.py [--drives N] [--hours H]

Simulated drives in curves at 0.4 m/s with 50 wheel readings per second. The noise of the wheels is that of
`OdometryOptions`, the noise of the gyroscope that of `ImuOptions`.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.shared.gyro_drive import SLIP_FROM_S, driven

RATES_RAD_S = (0.3, 0.5, 0.75, 1.0, 1.5, 2.0)
LENGTHS_S = (0.2, 0.5, 1.0)


def main() -> None:
    """Print the share of detected slips by yaw rate and duration, and the false alarms."""
    parser = argparse.ArgumentParser(description="slip detection with wheels and gyroscope")
    parser.add_argument("--drives", type=int, default=100, help="number of drives per rate and duration")
    parser.add_argument("--hours", type=float, default=1.0, help="hours of driving without slip")
    arguments = parser.parse_args()
    for slip_s in LENGTHS_S:
        shares = []
        for rate in RATES_RAD_S:
            runs = (
                driven(seed, SLIP_FROM_S + 0.5 + slip_s, slip_rad_s=rate, slip_s=slip_s)
                for seed in range(arguments.drives)
            )
            seen = sum(fused.slip.slips > 0 for _, fused, _ in runs)
            shares.append(f"{100.0 * seen / arguments.drives:.0f}")
        rates = ", ".join(f"{rate:g}" for rate in RATES_RAD_S)
        figure(f"detected slips of {slip_s:g} s at {rates} rad/s", " / ".join(shares), "%")
    _, fused, _ = driven(1, 3600.0 * arguments.hours)
    figure(f"slip detection: false alarms in {arguments.hours:g} h", str(fused.slip.slips))


if __name__ == "__main__":
    main()
