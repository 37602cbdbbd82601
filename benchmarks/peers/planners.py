"""Run ROS's navfn and our planners in turn on the same costmaps: `make bench-peers`.

Run: python -m benchmarks.peers.planners [--rounds 5]

Each round plans every pair once with each planner, one after the other. Times are CPU milliseconds of this
thread, with everything that a call of the planner does. A ratio is ours over navfn's Dijkstra in one round:
below 1 ours is faster. Behind each ratio are the least and the greatest of all rounds.
"""

import argparse
import ctypes
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from benchmarks.figure import figure, has_data
from benchmarks.navigation import DATA, NO_HITS, navfn_costmap
from benchmarks.peers.sources import NOT_BUILT, build_navfn
from benchmarks.scaling import GOAL, START, room_map
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.polyline import arc_lengths
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper_hil.kinematic.maps import ROS_FOOTPRINT, read_trinary

Pair = tuple[Pose2, Goal]
Plan = Callable[[Pose2, Goal], FloatArray | None]
PEER, PEER_ASTAR = "ROS navfn, Dijkstra to the goal", "ROS navfn, A*"


class RosNavfn:
    """ROS's navfn on one costmap."""

    def __init__(self, library: Path, costmap: Costmap) -> None:
        self._lib = ctypes.CDLL(str(library))
        self._lib.navfn_new.restype = ctypes.c_void_p
        self._lib.navfn_x.restype = self._lib.navfn_y.restype = ctypes.POINTER(ctypes.c_float)
        self._costmap = costmap
        self._costs = np.ascontiguousarray(costmap.costs)
        rows, columns = self._costs.shape
        self._size = columns, rows
        self._planner = ctypes.c_void_p(self._lib.navfn_new(columns, rows))

    def close(self) -> None:
        """Free its memory."""
        self._lib.navfn_delete(self._planner)

    def plan(self, start: Pose2, goal: Goal, *, astar: bool) -> FloatArray | None:
        """Return the path, shape (n, 2) [m]; None if there is none."""
        ends = [self._cell(start.x_m, start.y_m), self._cell(goal.x_m, goal.y_m)]
        costs = self._costs.ctypes.data_as(ctypes.c_char_p)
        count = self._lib.navfn_plan(self._planner, costs, *self._size, *ends, int(astar))
        if count == 0:
            return None
        axes = (self._lib.navfn_x(self._planner), self._lib.navfn_y(self._planner))
        cells = np.stack([np.ctypeslib.as_array(axis, (count,)) for axis in axes], axis=1)
        return (cells + 0.5) * self._costmap.resolution_m + self._costmap.origin_m

    def _cell(self, x_m: float, y_m: float) -> ctypes.Array[ctypes.c_int]:
        at = (np.array((x_m, y_m)) - self._costmap.origin_m) / self._costmap.resolution_m
        return (ctypes.c_int * 2)(*np.floor(at).astype(int))


def situations() -> Iterator[tuple[str, Costmap, Footprint, list[Pair]]]:
    """Yield name, costmap, footprint and pairs: two recorded maps, and a goal 3 m off in a large map."""
    if has_data(DATA):
        for name in ("willow-full-0.05", "depot"):
            costmap, _ = navfn_costmap(read_trinary(DATA / "ros_maps" / f"{name}.pgm"))
            table = np.loadtxt(DATA / "bench" / f"{name}_pairs.csv", delimiter=",", skiprows=1)
            ends_m: NDArray[np.float64] = 0.05 * (table[:, :4] + 0.5)
            pairs = [(Pose2(x_m=a, y_m=b), Goal(x_m=c, y_m=d)) for a, b, c, d in ends_m.tolist()]
            yield name.split("-")[0], costmap, ROS_FOOTPRINT, pairs
    footprint = Footprint()
    for side in (400, 4000):
        costmap = build_costmap(room_map(side), NO_HITS, footprint, CostmapOptions())
        yield f"goal 3 m off, {side} x {side}", costmap, footprint, [(START, GOAL)] * 5


def our_plans(costmap: Costmap, footprint: Footprint) -> dict[str, Plan]:
    """Return our planners on a costmap; unknown cells block, as for navfn."""
    known = TraversalCostOptions(allow_unknown=False)
    planners: dict[str, Planner] = {
        "navfn": NavfnPlanner(known),
        "astar": AStarPlanner(known),
        "lattice": LatticePlanner(LatticeOptions(), known, footprint),
    }

    def plan(planner: Planner, start: Pose2, goal: Goal) -> FloatArray | None:
        return planner.plan(costmap, start, goal).path_m

    return {name: partial(plan, planner) for name, planner in planners.items()}


def measure(plans: dict[str, Plan], pairs: list[Pair], rounds: int) -> dict[str, NDArray[np.float64]]:
    """Return the times of each planner, shape (rounds, pairs) [ms]; the first round is not counted."""
    times_ms = {name: np.zeros((rounds + 1, len(pairs))) for name in plans}
    for turn in range(rounds + 1):
        for k, (start, goal) in enumerate(pairs):
            for name, plan in plans.items():
                begun_s = time.thread_time()
                plan(start, goal)
                times_ms[name][turn, k] = 1e3 * (time.thread_time() - begun_s)
    return {name: times[1:] for name, times in times_ms.items()}


def report(where: str, plans: dict[str, Plan], pairs: list[Pair], rounds: int) -> None:
    """Measure and print a row for each planner."""
    times_ms = measure(plans, pairs, rounds)
    for name, times in times_ms.items():
        found, lengths = 0, []
        for start, goal in pairs:
            path_m, peers_m = plans[name](start, goal), plans[PEER](start, goal)
            found += path_m is not None
            if path_m is not None and peers_m is not None:
                lengths.append(float(arc_lengths(path_m)[-1] / arc_lengths(peers_m)[-1]))
        row = [f"{np.median(times):.2f} / {np.percentile(times, 95):.2f} ms"]
        for what, share in (("median", 50), ("95 %", 95)):
            ratios = np.percentile(times, share, axis=1) / np.percentile(times_ms[PEER], share, axis=1)
            row.append(f"{what} x {np.median(ratios):.3g} ({ratios.min():.3g} to {ratios.max():.3g})")
        row.append(f"length x {np.mean(lengths):.3f}")
        row.append(f"{found} of {len(pairs)} found")
        figure(f"{where}: {name}", "; ".join(row))


def main() -> int:
    """Build the peers, run them beside ours and print the ratios."""
    parser = argparse.ArgumentParser(description="our planners beside ROS's navfn, in turn")
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    for name, why in NOT_BUILT.items():
        print(f"not built: {name}: {why}")
    try:
        library = build_navfn()
    except (subprocess.CalledProcessError, FileNotFoundError) as error:
        print(f"navfn cannot be fetched or built: {error}", file=sys.stderr)
        return 1
    for where, costmap, footprint, pairs in situations():
        peer = RosNavfn(library, costmap)
        plans: dict[str, Plan] = {
            PEER: partial(peer.plan, astar=False),
            PEER_ASTAR: partial(peer.plan, astar=True),
            **our_plans(costmap, footprint),
        }
        report(where, plans, pairs, rounds)
        peer.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
