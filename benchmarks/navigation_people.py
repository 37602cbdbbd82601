"""Drive among people who walk at 1 m/s.

Run: python benchmarks/navigation_people.py [--scenes 60] [--speeds 0.4 ...]

The people cross the robot's path, pace across it, walk along it, or stand on it and leave. They never give
way. A contact is the robot's fault if the touched part of its footprint moved toward the person, and the
person had been in view for at least the stopping time. A contact from behind is counted separately.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper.navigation.options import NavigationOptions
from thumper_hil.kinematic.closed_loop import drive
from thumper_hil.kinematic.people import KinematicPedestrian, classify_contact, with_people
from thumper_hil.kinematic.world import KinematicWorld, box

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

HALL = KinematicWorld.from_boxes(box(2.0, 0.0, 7.0, 4.0))
AREA_M = (-4.0, -4.0, 12.0, 8.0)
START, GOAL = Pose2(x_m=0.0, y_m=0.0), Goal(x_m=4.5, y_m=0.0)
LIMIT_S = 90.0
OUTCOMES = ("arrived", "not arrived", "walked into", "caught from behind", "drove into a person")


def pacing(rng: np.random.Generator) -> list[KinematicPedestrian]:
    """Return one to three people who walk back and forth across the hall, straight or diagonally."""
    walkers = []
    for _ in range(int(rng.integers(1, 4))):
        x_m, side = float(rng.uniform(1.0, 3.8)), float(rng.choice((-1.7, 1.7)))
        there_m = (float(np.clip(x_m + rng.uniform(-1.0, 1.0), 0.9, 4.0)), -side)
        walkers.append(KinematicPedestrian(a_m=(x_m, side), b_m=there_m, from_s=float(rng.uniform(0.0, 6.0))))
    return walkers


def crossing(rng: np.random.Generator) -> list[KinematicPedestrian]:
    """Return the same people, each of whom crosses once."""
    return [replace(walker, returns=False) for walker in pacing(rng)]


def oncoming(rng: np.random.Generator) -> list[KinematicPedestrian]:
    """Return a person who walks along the robot's path toward it and past it."""
    y_m = float(rng.uniform(-0.6, 0.6))
    return [
        KinematicPedestrian(
            a_m=(5.2, y_m), b_m=(-1.0, y_m), from_s=float(rng.uniform(0.0, 5.0)), returns=False
        )
    ]


def blocking(rng: np.random.Generator) -> list[KinematicPedestrian]:
    """Return a person who stands on the robot's path and leaves."""
    x_m, side = float(rng.uniform(1.2, 3.5)), float(rng.choice((-1.6, 1.6)))
    y_m, leaves_s = float(rng.uniform(-0.2, 0.2)), float(rng.uniform(4.0, 15.0))
    place_m, aside_m = (x_m, y_m), (x_m, side)
    steps = [KinematicPedestrian(a_m=place_m, b_m=aside_m, from_s=leaves_s, returns=False)]
    return steps + crossing(rng)[:1] if rng.random() < 0.5 else steps


KINDS: dict[str, Callable[[np.random.Generator], list[KinematicPedestrian]]] = {
    "crossing": crossing,
    "pacing": pacing,
    "oncoming": oncoming,
    "blocking": blocking,
}


def outcome_of(walkers: list[KinematicPedestrian], options: NavigationOptions, seed: int) -> str:
    """Drive through one scene; return its outcome."""
    run = drive(
        lambda time_s: with_people(HALL, walkers, time_s),
        START,
        GOAL,
        AREA_M,
        seed=seed,
        options=options,
        limit_s=LIMIT_S,
    )
    if run.clearance_m < 0.0:
        return classify_contact(run.track, walkers, run.time_s, options.limits)
    return "arrived" if run.state is NavigationState.REACHED else "not arrived"


def main() -> None:
    """Run the scenes and print one row per kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=60, help="number of scenes per kind")
    parser.add_argument("--speeds", nargs="+", type=float, default=[0.4], help="fastest speeds [m/s]")
    given = parser.parse_args()
    usual = NavigationOptions()
    print(
        f"| people | v max [m/s] | scenes | {' | '.join(OUTCOMES)} |\n{'|---' * (3 + len(OUTCOMES))}|",
        flush=True,
    )
    for speed in given.speeds:
        options = replace(usual, limits=replace(usual.limits, v_max_m_s=speed))
        for kind, make in KINDS.items():
            count: Counter[str] = Counter()
            for seed in range(given.scenes):
                outcome = outcome_of(make(np.random.default_rng(seed)), options, seed)
                count[outcome] += 1
                if outcome not in ("arrived", "walked into"):
                    print(f"    {kind} {seed}: {outcome}", flush=True)
            row = " | ".join(str(count[outcome]) for outcome in OUTCOMES)
            print(f"| {kind} | {speed} | {given.scenes} | {row} |", flush=True)
            what = f"people {kind}, {given.scenes} scenes at {speed} m/s: robot drove into a person, arrived"
            figure(what, f"{count['drove into a person']} / {count['arrived']}", aim="0 / -")


if __name__ == "__main__":
    main()
