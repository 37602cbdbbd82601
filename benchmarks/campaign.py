"""Measure the CPU time of a campaign's drives per simulated second, and which part takes it.

Run: python benchmarks/campaign.py [--houses 4]

Drives the missions of `campaigns/houses.toml` under `nominal`, one after the other in this thread. The first
one also loads the kernels and is not counted. The shares do not overlap; the rest is the robot's loop, its
log and the opening of the robot.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from thumper.navigation.navigator import Navigator
from thumper.slam.mode_switch import SlamModeSwitch
from thumper_hil.bench import Bench
from thumper_hil.campaign.job import run_job
from thumper_hil.campaign.spec import expand_jobs, load_campaign
from thumper_hil.chip.chip import Chip
from thumper_hil.lidars.urg04lx import Urg04Lx

CAMPAIGN = Path(__file__).resolve().parents[1] / "campaigns" / "houses.toml"
PARTS: dict[str, tuple[type, str]] = {  # a part and its call; the simulated robot's holds the two before it
    "emulated ATmega328P with motors": (Chip, "run"),
    "simulated lidar": (Urg04Lx, "advance"),
    "rest of the simulated robot": (Bench, "advance"),
    "SLAM": (SlamModeSwitch, "update"),
    "navigation": (Navigator, "update"),
}
INSIDE = ("emulated ATmega328P with motors", "simulated lidar")


class Stopwatch:
    """Adds up the CPU time of a function's outermost calls."""

    def __init__(self, owner: type, name: str) -> None:
        self.cpu_s = 0.0
        function: Callable[..., Any] = getattr(owner, name)
        depth = 0

        def timed(*given: object, **named: object) -> object:
            nonlocal depth
            begun_s, depth = time.thread_time(), depth + 1
            try:
                return function(*given, **named)
            finally:
                depth -= 1
                if depth == 0:
                    self.cpu_s += time.thread_time() - begun_s

        setattr(owner, name, timed)


def main() -> None:
    """Drive and print the CPU time per simulated second, and the share of each part."""
    parser = argparse.ArgumentParser(description="CPU time of a campaign, and its shares")
    parser.add_argument("--houses", type=int, default=4, help="number of houses, from 1 on")
    houses = parser.parse_args().houses
    # Under `hard`, computing takes simulated time, and the drives follow the computer's load.
    jobs = expand_jobs(load_campaign(CAMPAIGN), CAMPAIGN.parent)[:houses]
    jobs = [replace(job, preset="nominal") for job in jobs]
    run_job(jobs[0])
    watches = {part: Stopwatch(*call) for part, call in PARTS.items()}
    begun_s = time.thread_time()
    simulated_s = sum(run_job(job).time_s for job in jobs)
    cpu_s = time.thread_time() - begun_s
    parts_s = {part: watch.cpu_s for part, watch in watches.items()}
    parts_s["rest of the simulated robot"] -= sum(parts_s[part] for part in INSIDE)
    parts_s["rest"] = cpu_s - sum(parts_s.values())
    what = f"drives in {len(jobs)} houses, {simulated_s:.0f} s simulated"
    figure(f"{what}: CPU per simulated second", f"{cpu_s / simulated_s:.3f}", "s", aim="<= 0.045")
    for part, part_s in parts_s.items():
        figure(f"{what}: share of {part}", f"{100.0 * part_s / cpu_s:.0f}", "%")


if __name__ == "__main__":
    main()
