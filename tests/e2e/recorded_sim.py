"""`thumper sim` that writes the bench's ground truth to a file when it ends.

Run: python tests/e2e/recorded_sim.py TRUTH.npy --board-pty PATH --lidar-pty PATH ...
"""

import sys

import numpy as np

from thumper.__main__ import main
from thumper_hil.bench import pty
from thumper_hil.bench.bench import Bench

BENCHES: list[Bench] = []


class RecordedBench(Bench):
    """A bench that this module keeps."""

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        BENCHES.append(self)


if __name__ == "__main__":
    path = sys.argv.pop(1)
    sys.argv[1:1] = ["sim"]
    vars(pty)["Bench"] = RecordedBench
    try:
        main()
    finally:
        np.save(path, BENCHES[0].truth())
