"""Measure how long `--help` takes (limit 0.5 s)."""

import statistics
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

LIMIT_S = 0.5
THUMPER = Path(sys.executable).with_name("thumper")
COMMANDS: tuple[tuple[str, ...], ...] = (
    (),
    ("demo",),
    ("run",),
    ("sim",),
    ("map-log",),
    ("doctor",),
    ("tune",),
    ("experiment",),
    ("calibrate",),
)


def main() -> None:
    """Print the median of five runs of each `--help`."""
    medians_s = {}
    for command in COMMANDS:
        times_s = []
        for _ in range(5):
            start_s = time.perf_counter()
            subprocess.run([THUMPER, *command, "--help"], check=True, capture_output=True)
            times_s.append(time.perf_counter() - start_s)
        medians_s[" ".join(["thumper", *command, "--help"])] = statistics.median(times_s)
    for command_line, median_s in medians_s.items():
        print(f"{command_line:24} {median_s:.2f} s")
    slowest = max(medians_s, key=lambda name: medians_s[name])
    figure(f"slowest help, `{slowest}`", f"{medians_s[slowest]:.2f}", "s", aim=f"<= {LIMIT_S}")


if __name__ == "__main__":
    main()
