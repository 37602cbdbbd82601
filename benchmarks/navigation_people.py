"""Drive among people who walk at 1 m/s, in the full simulator.

Run: python benchmarks/navigation_people.py [--presets nominal hard] [--scenes 20] [--first 0] [--speeds 0.4]

The people are two legs of 6 cm each. They cross the robot's path, pace across it, walk along it, or stand on
it and leave. They never give way. The bench judges each touch: it is the robot's if the robot moves towards
the leg and came nearer than the leg in the last 0.2 s, unless the leg was in its outline 0.2 s before; this
ends the drive. Touches by people end nothing.
"""

import argparse
import itertools
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from thumper.navigation.options import NavigationOptions
from thumper_hil.courses.course import CourseRun, drive_course
from thumper_hil.courses.people import KINDS, course_among
from thumper_hil.effects.preset import PRESETS

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

HEADINGS = (
    "preset | people | v max [m/s] | scenes | arrived | drove into a person "
    "| a person walked into it | touches by people | mean time [s]"
)


def line(preset: str, kind: str, speed: float, runs: list[CourseRun]) -> str:
    """Return the table row for the scenes of one kind."""
    arrived = [run.time_s for run in runs if run.reached]
    return (
        f"| {preset} | {kind} | {speed} | {len(runs)} | {len(arrived)} "
        f"| {sum(run.contacts > 0 for run in runs)} | {sum(run.touches_by_people > 0 for run in runs)} "
        f"| {sum(run.touches_by_people for run in runs)} "
        f"| {np.mean(arrived) if arrived else np.nan:.1f} |"
    )


def main() -> None:
    """Run the scenes and print one row per preset, speed and kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--presets", nargs="+", choices=PRESETS, default=["nominal"])
    parser.add_argument("--scenes", type=int, default=20, help="number of scenes per kind")
    parser.add_argument("--first", type=int, default=0, help="seed of the first scene")
    parser.add_argument("--speeds", nargs="+", type=float, default=[0.4], help="fastest speeds [m/s]")
    given = parser.parse_args()
    usual = NavigationOptions()
    print(f"| {HEADINGS} |\n|{'---|' * (HEADINGS.count('|') + 1)}", flush=True)
    for preset, speed, kind in itertools.product(given.presets, given.speeds, KINDS):
        options = replace(usual, limits=replace(usual.limits, v_max_m_s=speed))
        runs = []
        for seed in range(given.first, given.first + given.scenes):
            course = course_among(KINDS[kind](np.random.default_rng(seed)))
            run = drive_course(course, preset=preset, seed=seed, navigation=options)
            runs.append(run)
            if run.contacts or not run.reached:
                print(
                    f"    {kind} {seed}: {run.reason}, {run.time_s:.0f} s, "
                    f"touches by people {run.touches_by_people}",
                    flush=True,
                )
        print(line(preset, kind, speed, runs), flush=True)
        what = f"people {kind}, {preset}, {given.scenes} scenes at {speed} m/s"
        figure(
            f"{what}: robot drove into a person, arrived",
            f"{sum(run.contacts > 0 for run in runs)} / {sum(run.reached for run in runs)}",
            aim="0 / -",
        )


if __name__ == "__main__":
    main()
