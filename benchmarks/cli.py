"""How long `--help` takes: it must answer before the user wonders (limit 0.5 s)."""

import statistics
import subprocess
import sys
import time
from pathlib import Path

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
    print(f"{'command':24} median [s]   limit {LIMIT_S} s")
    for command in COMMANDS:
        times_s = []
        for _ in range(5):
            start_s = time.perf_counter()
            subprocess.run([THUMPER, *command, "--help"], check=True, capture_output=True)
            times_s.append(time.perf_counter() - start_s)
        print(f"{' '.join(['thumper', *command, '--help']):24} {statistics.median(times_s):.2f}")


if __name__ == "__main__":
    main()
