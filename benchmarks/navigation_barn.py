"""Drive through BARN worlds: `python benchmarks/navigation_barn.py [--controllers dwa ...] [--help]`.

20 recorded worlds (with --all, three hard ones more; with --made, 20 random worlds of the same kind) x
presets x scales x speeds x seeds, without a map, in the full simulator: firmware, motors, lidar and SLAM. The
output has one line for all seeds and the reason of every failed drive. --csv has a row per drive. A route
change is a new path that passes some post on another side; a flip is one that returns to a side left before.
The score is that of the challenge: success x OT / clip(time, 2 OT, 8 OT), where OT is the reference length
divided by 2 m/s. Recorded worlds come from $THUMPER_DATA (default ../shared/data).
"""

import argparse
import csv
import itertools
import os
import sys
import time
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

import numpy as np

from thumper.navigation.options import NavigationOptions
from thumper_hil.courses.barn import barn_course, random_world, recorded_world
from thumper_hil.courses.course import drive_course
from thumper_hil.courses.route_changes import count_route_changes
from thumper_hil.effects.preset import PRESETS

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, require_data

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2] / "shared" / "data")) / "nav" / "barn"
WORLDS = tuple(range(0, 300, 15))
HARD_WORLDS = (132, 138, 228)
OPTIMAL_M_S = 2.0
MOVE_BASE = {
    1.0: "ROS 1 move_base 20 of 20",
    0.61: "ROS 1 move_base 13 of 20 (as tight: 0.245 m wide, scale 0.50)",
    0.55: "ROS 1 move_base 12 of 20 (as tight: 0.245 m wide, scale 0.45)",
}
"""By scale. ROS 1 was measured with a footprint 0.245 m wide, ours is 0.30 m wide."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """One drive; a row of the CSV."""

    preset: str
    controller: str
    tracker: str
    scale: float
    v_max_m_s: float
    seed: int
    world: int
    outcome: str  # success, contact, timeout or abort
    time_s: float
    clearance_m: float
    pose_error_m: float
    score: float
    route_changes: int
    flips: int
    reason: str


def drive_one(
    options: NavigationOptions, *, made: bool, preset: str, world: int, scale: float, seed: int
) -> Drive:
    """Drive through one world and evaluate the run."""
    circles_m = random_world(world, scale) if made else recorded_world(DATA, world, scale)
    run = drive_course(barn_course(circles_m, scale), preset=preset, seed=seed, navigation=options)
    outcome = "timeout" if run.timed_out else "abort"
    if run.contacts:
        outcome = "contact"
    elif run.reached:
        outcome = "success"
    optimal_s = 0.0 if made else _reference_m(world) * scale / OPTIMAL_M_S
    score = optimal_s / min(max(run.time_s, 2.0 * optimal_s), 8.0 * optimal_s) if optimal_s else 0.0
    routes = count_route_changes(run.plans, circles_m[:, :2])
    return Drive(
        preset=preset,
        controller=options.controller,
        tracker=options.tracker,
        scale=scale,
        v_max_m_s=options.limits.v_max_m_s,
        seed=seed,
        world=world,
        outcome=outcome,
        time_s=run.time_s,
        clearance_m=run.clearance_m,
        pose_error_m=run.pose_error_m,
        score=score if outcome == "success" else 0.0,
        route_changes=routes.changes,
        flips=routes.flips,
        reason=run.reason,
    )


def _reference_m(world: int) -> float:
    with (DATA / "index.csv").open(newline="", encoding="utf-8") as stream:
        row = next(row for row in csv.DictReader(stream) if int(row["world"]) == world)
    return float(row["reference_path_length_m"])


def line(drives: list[Drive]) -> str:
    """Return the table row for the drives of a controller at one speed and scale."""
    first = drives[0]
    count = {
        kind: sum(d.outcome == kind for d in drives) for kind in ("success", "contact", "timeout", "abort")
    }
    times = [d.time_s for d in drives if d.outcome == "success"]
    name = first.controller + (f" + {first.tracker}" if first.tracker else "")
    return (
        f"| {first.preset} | {name} | {first.scale:.2f} | {first.v_max_m_s:.1f} | {_seeds(drives)} "
        f"| {count['success']}/{len(drives)} | {count['contact']} | {count['timeout']} | {count['abort']} "
        f"| {np.mean(times) if times else np.nan:.1f} | {np.median([d.clearance_m for d in drives]):.3f} "
        f"| {min(d.clearance_m for d in drives):.3f} | {np.median([d.pose_error_m for d in drives]):.3f} "
        f"| {np.mean([d.score for d in drives]):.3f} "
        f"| {np.mean([d.route_changes for d in drives]):.2f} | {np.mean([d.flips for d in drives]):.2f} |"
    )


def _seeds(drives: list[Drive]) -> str:
    seeds = sorted({drive.seed for drive in drives})
    return f"{seeds[0]} … {seeds[-1]}" if len(seeds) > 1 else str(seeds[0])


def report(drives: list[Drive]) -> None:
    """Record the figures for the table of all benchmarks."""
    first, count = drives[0], sum(d.outcome == "success" for d in drives)
    name = first.controller + (f" + {first.tracker}" if first.tracker else "") + f", {first.preset}"
    figure(
        f"BARN x {first.scale:.2f}, {name}, {first.v_max_m_s} m/s, seed {_seeds(drives)}: successes",
        f"{count} of {len(drives)}",
        aim={1.0: "20 of 20", 0.61: "18 of 20", 0.55: "17 of 20"}.get(first.scale, ""),
        peers=MOVE_BASE.get(first.scale, ""),
    )
    figure(
        f"BARN x {first.scale:.2f}, {name}: contacts",
        str(sum(d.outcome == "contact" for d in drives)),
        aim="0",
    )


HEADINGS = (
    "preset | controller | scale | v max [m/s] | seeds | success | contact | timeout | abort | mean time [s] "
    "| clearance, median [m] | minimum [m] | pose error, median [m] | score | route changes | flips"
)


def main() -> None:
    """Run all combinations of the options and print their rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--presets", nargs="+", choices=PRESETS, default=["nominal"])
    parser.add_argument("--controllers", nargs="+", default=["dwa"])
    parser.add_argument("--tracker", default="cascade", help="path tracker; '' for none")
    parser.add_argument("--scales", nargs="+", type=float, default=[1.0, 0.61, 0.55, 0.50])
    parser.add_argument("--speeds", nargs="+", type=float, default=[0.5])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument(
        "--made",
        type=int,
        nargs="?",
        const=0,
        metavar="FIRST",
        help="use 20 random worlds instead of the recorded ones, with seeds from this number on",
    )
    parser.add_argument("--all", action="store_true", help="drive the three hard worlds as well")
    parser.add_argument("--csv", type=Path, help="write one row per drive to this file")
    given = parser.parse_args()
    is_made = given.made is not None
    if not is_made:
        require_data(DATA)
    worlds = WORLDS + HARD_WORLDS * given.all
    if is_made:
        worlds = tuple(range(given.made, given.made + len(WORLDS)))
    usual = NavigationOptions(tracker=given.tracker)
    all_drives: list[Drive] = []
    print(f"| {HEADINGS} |\n|{'---|' * (HEADINGS.count('|') + 1)}", flush=True)
    for preset, name, speed, scale in itertools.product(
        given.presets, given.controllers, given.speeds, given.scales
    ):
        options = replace(usual, controller=name, limits=replace(usual.limits, v_max_m_s=speed))
        start = time.process_time()
        drives = [
            drive_one(options, made=is_made, preset=preset, world=world, scale=scale, seed=seed)
            for seed in given.seeds
            for world in worlds
        ]
        all_drives += drives
        print(line(drives), flush=True)
        report(drives)
        for drive in drives:
            if drive.outcome != "success":
                which = f"world {drive.world}, seed {drive.seed}"
                print(f"    {which}: {drive.outcome} at {drive.time_s:.0f} s, {drive.reason}")
        simulated_s = sum(drive.time_s for drive in drives)
        print(f"    {(time.process_time() - start) / simulated_s:.3f} core s per simulated s", flush=True)
        if given.csv:
            with given.csv.open("w", newline="", encoding="utf-8") as stream:
                writer = csv.writer(stream, lineterminator="\n")
                writer.writerow([field.name for field in fields(Drive)])
                writer.writerows(astuple(drive) for drive in all_drives)


if __name__ == "__main__":
    main()
