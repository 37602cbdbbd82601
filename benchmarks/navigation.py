"""Figures of navigation: `python benchmarks/navigation.py [planner] [rollouts] [cycle]`, or
`... barn|made CONTROLLER SEED SCALE ...` for 20 recorded BARN worlds, or 20 made ones of the same kind.

Without arguments: planner, rollouts and cycle. Recorded maps come from $THUMPER_DATA (default
../shared/data). Times are CPU milliseconds of this thread.
"""

import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.host.navigation.barn import (  # noqa: E402
    drive_through,
    has_arrived,
    made_world,
    recorded_world,
)
from tests.host.navigation.closed_loop import drive  # noqa: E402
from tests.host.navigation.maps import read_pgm, read_trinary  # noqa: E402
from tests.host.navigation.world import World, box  # noqa: E402
from thumper.geometry import Pose2, Twist2  # noqa: E402
from thumper.mapping.grid import OccupancyGrid  # noqa: E402
from thumper.navigation.astar import AStarOptions, AStarPlanner  # noqa: E402
from thumper.navigation.controller import ControlRequest  # noqa: E402
from thumper.navigation.costmap import Costmap, CostmapOptions, build_costmap  # noqa: E402
from thumper.navigation.dwa import DwaController, DwaOptions  # noqa: E402
from thumper.navigation.footprint import Footprint  # noqa: E402
from thumper.navigation.goal import Goal  # noqa: E402
from thumper.navigation.inflation import LETHAL, UNKNOWN, squared_distances  # noqa: E402
from thumper.navigation.lattice import LatticeOptions, LatticePlanner  # noqa: E402
from thumper.navigation.limits import SpeedLimits  # noqa: E402
from thumper.navigation.mppi import MppiController, MppiOptions  # noqa: E402
from thumper.navigation.navfn import NavfnOptions, NavfnPlanner  # noqa: E402
from thumper.navigation.navigator import Navigator  # noqa: E402
from thumper.navigation.options import NavigationOptions  # noqa: E402
from thumper.navigation.path import arc_lengths  # noqa: E402
from thumper.navigation.planner import Planner  # noqa: E402

DATA = Path(os.environ.get("THUMPER_DATA", ROOT.parent / "shared" / "data")) / "nav"
NO_HITS = np.empty((0, 2))
PEER_COSTS = CostmapOptions(inflation_radius_m=0.55, decay_per_m=10.0)


def cpu_ms(work: Callable[[], object], repeats: int) -> float:
    """Least CPU time of some repeats."""
    times = []
    for _ in range(repeats):
        begun = time.thread_time()
        work()
        times.append(time.thread_time() - begun)
    return 1e3 * min(times)


def navfn_costmap(cells: NDArray[np.int8]) -> tuple[Costmap, float]:
    """The costmap that the recorded navfn paths were planned on, and the time to inflate it.

    There an inflated cost replaces "unknown", so that unknown ground near obstacles can be crossed.
    """
    known = np.maximum(cells, 0).astype(np.int8)
    grid = OccupancyGrid(cells=known, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    inflate = partial(build_costmap, grid, NO_HITS, Footprint(), PEER_COSTS)
    costmap = inflate()
    costs = np.where((cells < 0) & (costmap.costs == 0), UNKNOWN, costmap.costs).astype(np.uint8)
    return replace(costmap, costs=costs), cpu_ms(inflate, 5)


def planner() -> None:
    """The pairs of the real navfn: time, and length against its Dijkstra path."""
    print("planner: 50 pairs a map, unknown blocked")
    planners: dict[str, Planner] = {
        "navfn": NavfnPlanner(NavfnOptions(allow_unknown=False)),
        "navfn, unguided": NavfnPlanner(NavfnOptions(allow_unknown=False, guided=False)),
        "astar": AStarPlanner(AStarOptions(allow_unknown=False)),
        "lattice": LatticePlanner(LatticeOptions(allow_unknown=False), Footprint()),
    }
    for name in ("willow-full-0.05", "depot"):
        costmap, inflate_ms = navfn_costmap(read_trinary(DATA / "ros_maps" / f"{name}.pgm"))
        print(f"  {name}: costmap {inflate_ms:.1f} ms")
        pairs = np.loadtxt(DATA / "bench" / f"{name}_pairs.csv", delimiter=",", skiprows=1)
        for title, chosen in planners.items():
            times, ratios = [], []
            for start_col, start_row, goal_col, goal_row, navfn_m, _ in pairs:
                start = Pose2(x_m=0.05 * (start_col + 0.5), y_m=0.05 * (start_row + 0.5))
                goal = Goal(x_m=0.05 * (goal_col + 0.5), y_m=0.05 * (goal_row + 0.5))
                plan = partial(chosen.plan, costmap, start, goal)
                path_m = plan().path_m
                if path_m is not None:
                    ratios.append(float(arc_lengths(path_m)[-1]) / navfn_m)
                    times.append(cpu_ms(plan, 2))
            p50, p95 = np.percentile(times, (50, 95))
            print(
                f"    {title}: {len(ratios)}/{len(pairs)} found, {p50:.2f} ms (p95 {p95:.1f}), "
                f"length x {np.mean(ratios):.3f} of navfn"
            )
    lethal = read_pgm(DATA / "oracle" / "inflation_in_120.pgm") == LETHAL
    squared_distances(lethal, 11)
    print(f"  inflation distances 120 x 120: {cpu_ms(partial(squared_distances, lethal, 11), 50):.3f} ms")


def window_request(name: str) -> ControlRequest:
    """A robot in one of the real 6 m windows, its path straight ahead."""
    lethal = read_pgm(DATA / "oracle" / f"costmap_{name}.pgm") == LETHAL
    cells = np.where(lethal, 100, 0).astype(np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    costmap = build_costmap(grid, NO_HITS, Footprint(), PEER_COSTS)
    inner = costmap.squared_cells[20:100, 20:80]
    row, col = np.unravel_index(int(np.argmax(inner)), inner.shape)
    pose = Pose2(x_m=0.05 * (col + 20.5), y_m=0.05 * (row + 20.5))
    along_m = np.arange(0.0, 1.5, 0.05)
    path_m = np.column_stack((pose.x_m + along_m, np.full(along_m.size, pose.y_m)))
    moving = Twist2(v_m_s=0.2)
    return ControlRequest(
        map_from_base=pose,
        twist=moving,
        last_command=moving,
        path_m=path_m,
        costmap=costmap,
        v_limit_m_s=0.4,
        period_s=0.1,
    )


def rollouts() -> None:
    """One controller cycle: the default window, and the 2020 x 20 of the peers' table."""
    print("rollouts: one DWA cycle (footprint check, path, goal and front terms)")
    for name in ("open", "median", "tight"):
        request = window_request(name)
        line = f"  {name}:"
        for v_samples, w_samples, horizon_s in ((7, 21, 1.7), (20, 101, 2.0)):
            options = DwaOptions(v_samples=v_samples, w_samples=w_samples, horizon_s=horizon_s)
            controller = DwaController(options, SpeedLimits(), Footprint())
            controller.command(request)
            work_ms = cpu_ms(partial(controller.command, request), 20)
            line += f"  {v_samples * w_samples} x {round(horizon_s / 0.1)}: {1e3 * work_ms:.0f} us"
        mppi = MppiController(MppiOptions(futures=2000, steps=56), SpeedLimits(), Footprint())
        mppi.command(request)
        print(f"{line}  MPPI 2000 x 56: {1e3 * cpu_ms(partial(mppi.command, request), 10):.0f} us")


def cycle() -> None:
    """The whole `Navigator.update` on a 10 m x 10 m map at 0.05 m, in a mission that maps as it goes."""
    times: list[float] = []
    original = Navigator.update

    def timed(self: Navigator, *inputs: object) -> object:
        begun = time.thread_time()
        output = original(self, *inputs)  # type: ignore[arg-type]
        times.append(time.thread_time() - begun)
        return output

    Navigator.update = timed  # type: ignore[method-assign,assignment]
    room = World.of(box(0.8, 0.0, 4.8, 3.8), box(1.2, 0.1, 0.40, 0.30, 0.58))
    start, goal = Pose2(x_m=2.05, y_m=0.64, theta_rad=-2.56), Goal(x_m=0.38, y_m=-0.45)
    for seed in range(6):
        drive(room, start, goal, (-4.2, -5.0, 10.0, 10.0), seed=seed)
        if seed == 0:
            times.clear()  # kernels were loaded in the first run
    Navigator.update = original  # type: ignore[method-assign]
    p50, p99 = 1e3 * np.percentile(times, (50, 99))
    print(f"cycle: {len(times)} updates, p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {1e3 * max(times):.2f} ms")


def barn(kind: str, controller: str, seed: int, scale: float) -> None:
    """20 BARN worlds, rules and speed (0.5 m/s) of the peers' table; exact pose, 1 cm range noise."""
    options = NavigationOptions(limits=SpeedLimits(v_max_m_s=0.5), controller=controller)
    times, least_m, contacts = [], math.inf, 0
    for k in range(20):
        world = made_world(k, scale) if kind == "made" else recorded_world(DATA / "barn", 15 * k, scale)
        run = drive_through(world, scale, options, seed)
        least_m = min(least_m, run.clearance_m)
        contacts += run.clearance_m < 0.0
        if has_arrived(run, scale):
            times.append(run.time_s)
        else:
            print(f"  world {k}: {run.time_s:.0f} s, {run.state.value}, {run.reason}")
    print(
        f"{kind} x {scale}, {controller}, seed {seed}: {len(times)}/20, {contacts} contacts, "
        f"mean {np.mean(times):.1f} s, least clearance {least_m:.3f} m",
        flush=True,
    )


def main(arguments: list[str]) -> None:
    """Run what was asked for."""
    parts = {"planner": planner, "rollouts": rollouts, "cycle": cycle}
    if arguments and arguments[0] in ("barn", "made"):
        kind, controller, seed, *scales = arguments
        for scale in map(float, scales):
            barn(kind, controller, int(seed), scale)
        return
    for name in arguments or parts:
        parts[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
