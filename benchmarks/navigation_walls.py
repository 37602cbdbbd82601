"""Drive to goals near walls: `python benchmarks/navigation_walls.py [--rooms 60] [--seed 1] [--preset hard]`.

Random rooms with a box, goals 6 cm to 28 cm from a wall or in a corner, half of them with a heading. A search
over x, y and heading, which knows the room, says whether the robot can reach a pose within the tolerances of
the goal with `--spare` metres to spare on all sides. Prints how many of these goals are reached, how long the
last half metre takes, and how soon the other goals end. Lists all drives that did not end as they should.
The drives are in the kinematic simulator. `--preset` sets the body and the bracket; the lidar has white noise
only, and host time does not count.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thumper.common.geometry import Pose2
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper_hil.effects.preset import PRESETS
from thumper_hil.kinematic.base import TICK_S
from thumper_hil.kinematic.closed_loop import CYCLE_TICKS, Conditions, Run, drive
from thumper_hil.kinematic.reachable_poses import at_goal, reachable_poses
from thumper_hil.kinematic.world import KinematicWorld, box

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

AREA_M = (-3.0, -3.0, 9.0, 6.0)
MIDDLE_M = 0.4  # x of the room's middle
LIMIT_S = 120.0
LEAST_DISTANCE_M = 0.8
LAST_M = 0.5
TURNING_M = 0.35  # room round the start


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """A room with a start and a goal."""

    seed: int
    world: KinematicWorld
    size_m: tuple[float, float]
    start: Pose2
    goal: Goal
    wall_m: float  # from the goal to the nearest wall


def rooms(count: int, seed: int) -> Iterator[Room]:
    """Yield random rooms in which the robot can turn at the start and the goal is not beside it."""
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        width_m, height_m = float(rng.uniform(2.6, 4.5)), float(rng.uniform(2.2, 3.6))
        left_m, right_m, top_m = MIDDLE_M - 0.5 * width_m, MIDDLE_M + 0.5 * width_m, 0.5 * height_m
        obstacle = box(MIDDLE_M + float(rng.uniform(-0.2, 0.6)), float(rng.uniform(-0.5, 0.5)), 0.3, 0.2)
        world = KinematicWorld.from_boxes(box(MIDDLE_M, 0.0, width_m, height_m), obstacle)
        start = Pose2(x_m=left_m + 0.7, y_m=0.7 - top_m, theta_rad=float(rng.uniform(-3.1, 3.1)))
        wall_m, corner_m, along = rng.uniform(0.06, 0.28), rng.uniform(0.06, 0.28), rng.uniform(-0.5, 0.5)
        place_m = (
            (right_m - wall_m, along * (height_m - 0.3)),
            (MIDDLE_M + along * (width_m - 0.3), top_m - wall_m),
            (MIDDLE_M + along * (width_m - 0.3), wall_m - top_m),
            (right_m - wall_m, top_m - corner_m),
        )[int(rng.integers(4))]
        theta_rad = None if rng.random() < 0.5 else 0.5 * math.pi * int(rng.integers(4))
        goal = Goal(x_m=float(place_m[0]), y_m=float(place_m[1]), theta_rad=theta_rad)
        disc = Footprint.rectangle(length_m=2.0 * TURNING_M, width_m=2.0 * TURNING_M)
        if goal.distance_m(start) < LEAST_DISTANCE_M or world.clearance_m(start, disc) <= 0.0:
            continue
        made += 1
        yield Room(
            seed=made, world=world, size_m=(width_m, height_m), start=start, goal=goal, wall_m=float(wall_m)
        )


def is_possible(room: Room, spare_m: float) -> bool:
    """Return whether a pose at the goal can be reached with `spare_m` to spare."""
    width_m, height_m = room.size_m
    box_m = (MIDDLE_M - 0.5 * width_m, -0.5 * height_m, width_m, height_m)
    poses = reachable_poses(room.world, Footprint().grown(spare_m), room.start, box_m)
    return bool(at_goal(poses, room.goal).any())


def last_s(run: Run, goal: Goal) -> float:
    """Return the time that the drive took from `LAST_M` before the goal."""
    near = (i for i, pose in enumerate(run.track) if goal.distance_m(pose) <= LAST_M)
    return run.time_s - next(near, 0) * CYCLE_TICKS * TICK_S


def text_of(room: Room, run: Run) -> str:
    """Return a line about a drive."""
    heading = "any heading" if room.goal.theta_rad is None else f"heading {room.goal.theta_rad:.2f}"
    return (
        f"    room {room.seed}: {room.wall_m:.2f} m from the wall, {heading}: {run.state.value} after "
        f"{run.time_s:.0f} s, {run.goal_error_m:.2f} m from the goal; {run.reason}"
    )


def main() -> None:
    """Drive in all rooms and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rooms", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1, help="of the rooms")
    parser.add_argument("--spare", type=float, default=0.03, help="room that a possible goal leaves [m]")
    parser.add_argument("--preset", choices=PRESETS, default="nominal")
    parser.add_argument("--only", type=int, nargs="+", help="drive only in these rooms")
    parser.add_argument("--quick", type=float, default=20.0, help="an impossible goal ends within this [s]")
    given = parser.parse_args()
    reached: list[tuple[Room, Run]] = []
    missed: list[tuple[Room, Run]] = []
    others: list[tuple[Room, Run]] = []
    for room in rooms(given.rooms, given.seed):
        if given.only and room.seed not in given.only:
            continue
        conditions = Conditions(preset=given.preset, known_start=True)
        run = drive(
            room.world, room.start, room.goal, AREA_M, seed=room.seed, conditions=conditions, limit_s=LIMIT_S
        )
        arrived = run.state is NavigationState.REACHED and run.clearance_m > 0.0
        possible = is_possible(room, given.spare)
        (reached if possible and arrived else missed if possible else others).append((room, run))
    every = reached + missed + others
    name = f"goals near walls, kinematic simulator, {given.preset} body, rooms of seed {given.seed}"
    figure(f"{name}: reached", f"{len(reached)} of {len(reached) + len(missed)}", aim=">= 95 %")
    figure(f"{name}: contacts", str(sum(run.clearance_m <= 0.0 for _, run in every)), aim="0")
    for label, runs in (("last half metre", reached), ("whole drive", reached), ("other goals", others)):
        times_s = [last_s(run, room.goal) if label == "last half metre" else run.time_s for room, run in runs]
        if times_s:
            middle_s, slow_s = np.percentile(times_s, (50, 90))
            figure(f"{name}: {label}, median / 90 %", f"{middle_s:.1f} / {slow_s:.1f}", "s")
    also = sum(run.state is NavigationState.REACHED for _, run in others)
    figure(f"{name}: other goals, reached all the same", f"{also} of {len(others)}")
    if reached:
        worst_m = max(run.goal_error_m for _, run in reached)
        figure(f"{name}: worst true distance to the goal", f"{worst_m:.3f}", "m")
    figure(f"{name}: least clearance", f"{min(run.clearance_m for _, run in every):.3f}", "m", aim="> 0")
    for room, run in missed:
        print(text_of(room, run))
    slow = [
        one for one in others if one[1].state is not NavigationState.REACHED and one[1].time_s > given.quick
    ]
    if slow:
        print("  impossible, and slow to end:")
        print("\n".join(text_of(room, run) for room, run in slow))


if __name__ == "__main__":
    main()
