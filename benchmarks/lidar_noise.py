"""Compare the error codes and losses of a real URG-04LX with those of the simulated one.

Run: python benchmarks/lidar_noise.py [LOG]

The default log is the MINES log in $THUMPER_DATA. For the simulated lidar the log's ranges are the truth, and
the log's error codes mean no target. Beams 0-52 and 659-681 are left out, because the robot of the log hides
them.
"""

import gzip
import os
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper_hil.lidars.urg_noise import device_bias, measure_mm

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, require_data

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2] / "shared" / "data"))
CODES = (0, 7, 6, 1, 2, 10, 8, 15)
EDGES_MM = (20, 1000, 1500, 2000, 3000, 4000, 5601)


def read_log(path: Path) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return ranges and codes, shape (scans, 606), and the wheel counts, shape (scans, 2)."""
    with gzip.open(path, "rt") as lines:
        rows = [line.split() for line in lines]
    values_mm = np.array([[int(word) for word in row[24:706]] for row in rows], np.int32)[:, 53:659]
    return values_mm, np.array([[int(word) for word in row[2:4]] for row in rows], np.int32)


def main() -> None:
    """Print both tables."""
    log = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA / "slam" / "mines-exp1.dat.gz"
    require_data(log)
    real_mm, counts = read_log(log)
    rng = np.random.default_rng(1)
    bias = device_bias(real_mm.shape[1], rng)
    simulated_mm = np.array(
        [measure_mm(np.where(scan >= 20, 1e-3 * scan, np.inf), bias, rng) for scan in real_mm]
    )
    print("code      real   simulated  [% of beams]")
    for code in CODES:
        print(
            f"{code:4d}  {100 * (real_mm == code).mean():8.3f}  {100 * (simulated_mm == code).mean():10.3f}"
        )
    valid = [f"{100 * (values >= 20).mean():.1f}" for values in (real_mm, simulated_mm)]
    source = "MINES log, recorded by a real one"
    figure("simulated URG-04LX: beams with a range", valid[1], "%", peers=f"real {valid[0]}", source=source)
    quartiles = [np.percentile(values[values >= 20], [5, 50, 95]) for values in (real_mm, simulated_mm)]
    print(f"valid ranges, 5/50/95 %: real {quartiles[0]} mm, simulated {quartiles[1]} mm")

    # While stationary, one scan is the truth for the next; "simulated" is one measurement of that truth.
    still = np.flatnonzero((np.diff(counts, axis=0) == 0).all(axis=1))
    print("range [mm]    lost from scan to scan, real / simulated [%]   sigma, real / simulated [mm]")
    for low_mm, high_mm in pairwise(EDGES_MM):
        before, after = real_mm[still], real_mm[still + 1]
        chosen = (before >= low_mm) & (before < high_mm)
        same = chosen & (after >= 20) & (np.abs(after - before) < 200)
        real_sigma_mm = 1.4826 * np.median(np.abs((after - before)[same])) / np.sqrt(2.0)
        truth_m = 1e-3 * np.clip(np.linspace(low_mm, high_mm, 606), 500, None)
        walls = np.array([measure_mm(truth_m, np.zeros(606), rng) for _ in range(200)]).astype(np.float64)
        lost = walls < 20
        walls[lost] = np.nan
        sigma_mm = f"{np.median(np.nanstd(walls, axis=0)):.1f}"
        if low_mm == 1000:
            figure(
                "simulated URG-04LX: noise, 1.0 to 1.5 m",
                sigma_mm,
                "mm",
                peers=f"real {real_sigma_mm:.1f}",
                source=source,
            )
        print(
            f"{low_mm:5d}-{high_mm:4d}  {100 * (after[chosen] < 20).mean():20.1f} / {100 * lost.mean():.1f}"
            f"  {real_sigma_mm:32.1f} / {sigma_mm}"
        )


if __name__ == "__main__":
    main()
