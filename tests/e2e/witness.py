"""`thumper sim` on two pseudo-terminals that also prints when the motors are driven; run as a program.

A line of JSON each 20 ms of simulated time and at each change: its time, the wall's, whether a motor has PWM,
the true pose and the contacts so far. SIGUSR1 pulls the board's plug, SIGUSR2 puts it back.
"""

import json
import signal
import sys
import time
from pathlib import Path
from typing import Any

from thumper_hil.bench import pty
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.options import BenchOptions

OCR2A, OCR2B = 0xB3, 0xB4  # both motors' duty
PERIOD_S = 0.02

wanted: list[str] = []


class Witness(Bench):
    """A bench that prints the motor state."""

    def __init__(self, options: BenchOptions) -> None:
        super().__init__(options)
        self._told = (-1.0, False)

    def advance(self, until_s: float, *, board_bytes: int = 0) -> None:
        while wanted:
            self.fault("board", wanted.pop())
        super().advance(until_s, board_bytes=board_bytes)
        driven = bool(self.chip.data(OCR2A) or self.chip.data(OCR2B))
        if driven != self._told[1] or self.time_s >= self._told[0] + PERIOD_S:
            self._told = (self.time_s, driven)
            line: dict[str, Any] = {"sim_s": self.time_s, "wall_s": time.monotonic(), "on": driven}
            line |= {"pose": self._true_pose(), "contacts": self.contacts}
            print(json.dumps(line), flush=True)

    def _true_pose(self) -> tuple[float, ...]:
        pose = self.chip.truth().map_from_base
        return (pose.x_m, pose.y_m, pose.theta_rad)


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, lambda *_: wanted.append("unplugged"))
    signal.signal(signal.SIGUSR2, lambda *_: wanted.append("ok"))
    vars(pty)["Bench"] = Witness
    board, lidar, x_m, y_m, yaw_deg = sys.argv[1:]
    pty.serve(Path(board), Path(lidar), {"world": "lab", "x_m": x_m, "y_m": y_m, "yaw_deg": yaw_deg})
