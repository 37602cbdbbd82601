"""Measure the cost of recording: message rate, share of a core, and lateness of a loop that records.

Run: python benchmarks/recording.py [--seconds S]

The messages are those of a robot's control cycle (wheels, a scan of 682 beams, odometry, pose, transforms,
command, status; map and plan once per second). A robot runs 10 cycles per second. The loop of the last rows
runs at 50 Hz and publishes a whole cycle each time. Lateness is the wake-up time after the due time.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from thumper.common.geometry import FloatArray
from thumper.recording.recorder import Recorder

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.shared.recorded_run import RUN, cycle, cycles

BEATS_PER_S = 10.0
LOOP_HZ = 50.0
QUEUE_SIZE = 1_000_000


def throughput(folder: Path) -> tuple[float, float, float]:
    """Return messages per second from queue to disk, the multiple of real time, and bytes per second."""
    messages = list(cycles(1500))
    start_s = time.perf_counter()
    recorder = Recorder(folder, RUN, queue_size=QUEUE_SIZE)
    for topic, now_s, message in messages:
        recorder(topic, now_s, message)
    recorder.close()
    taken_s = time.perf_counter() - start_s
    robot_s = 1500 / BEATS_PER_S
    size = sum(path.stat().st_size for path in recorder.files)
    return len(messages) / taken_s, robot_s / taken_s, size / robot_s


def loop(folder: Path | None, seconds: float) -> tuple[FloatArray, float]:
    """Return the lateness of each cycle [s] and the share of a core; record to `folder` unless None."""
    made = [list(cycle(k)) for k in range(20)]
    recorder = Recorder(folder, RUN, queue_size=QUEUE_SIZE) if folder else None
    late, cpu_s, start_s = [], time.process_time(), time.perf_counter()
    for k in range(round(seconds * LOOP_HZ)):
        due_s = start_s + k / LOOP_HZ
        time.sleep(max(0.0, due_s - time.perf_counter()))
        late.append(time.perf_counter() - due_s)
        if recorder:
            for topic, now_s, message in made[k % len(made)]:
                recorder(topic, now_s + k / LOOP_HZ, message)
    share = (time.process_time() - cpu_s) / (time.perf_counter() - start_s)
    if recorder:
        recorder.close()
        assert recorder.dropped == 0
    return np.array(late), share


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="duration of each loop")
    seconds = parser.parse_args().seconds
    table = Table(
        "what", "figure", title=f"recording (load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores)"
    )
    with tempfile.TemporaryDirectory() as scratch:
        rates = [throughput(Path(scratch) / f"t{k}") for k in range(3)]
        rate, factor, bytes_s = max(rates)
        table.add_row("messages per second, written and synced", f"{rate:,.0f}")
        table.add_row("multiple of real time", f"{factor:,.0f}")
        table.add_row("size on disk", f"{1e-3 * bytes_s:.0f} kB/s")
        runs = {True: [], False: []}  # type: dict[bool, list[tuple[FloatArray, float]]]
        for k in range(3):
            for recording in (False, True):
                runs[recording].append(loop(Path(scratch) / f"l{k}" if recording else None, seconds))
        for recording, name in ((False, "without"), (True, "with")):
            late, share = min(runs[recording], key=lambda run: float(np.percentile(run[0], 99)))
            p50, p99 = np.percentile(1e3 * late, (50, 99))
            figures = f"late p50 {p50:.2f}, p99 {p99:.2f}, max {1e3 * late.max():.1f} ms"
            table.add_row(f"50 Hz loop {name} recording", f"{figures}; {100.0 * share:.1f} % of a core")
            figure(f"50 Hz loop {name} recording: lateness, 99 %", f"{p99:.1f}", "ms")
    figure("recording: messages written and synced", f"{rate:.0f}", "per second",
           peers="mcap + rosbags 28 600, mcap-ros2-support 6 100, foxglove-sdk 55 600",
           source="other messages, not synced, a machine of the same kind")  # fmt: skip
    Console().print(table)


if __name__ == "__main__":
    main()
