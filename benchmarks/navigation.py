"""Measure navigation: `python benchmarks/navigation.py [planner] [costmap] [rollouts] [cycle] [loop]`.

Without arguments all parts run. Recorded maps come from $THUMPER_DATA (default ../shared/data). Times are CPU
milliseconds of this thread.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from thumper.common.geometry import Pose2, Twist2
from thumper.maps.distance_transform import squared_distances
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.dwa import DwaController, DwaOptions
from thumper.navigation.controllers.mppi import MppiController, MppiOptions
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.costmap.inflation import LETHAL, UNKNOWN
from thumper.navigation.costmap.layers import CostmapLayers
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.polyline import arc_lengths
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.speed_limits import SpeedLimits
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.state_estimator import StateEstimator
from thumper_hil.demo.missions import MISSIONS
from thumper_hil.demo.run import drive_mission
from thumper_hil.kinematic.closed_loop import drive
from thumper_hil.kinematic.maps import ROS_FOOTPRINT, read_pgm, read_trinary
from thumper_hil.kinematic.world import KinematicWorld, box

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, has_data

SAME = "ROS's C++ on the same input, a machine of the same kind"
NAVFN_MS = {"willow-full-0.05": 13.7, "depot": 2.2}
DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2] / "shared" / "data")) / "nav"
NO_HITS = np.empty((0, 2))
PEER_COSTS = CostmapOptions(inflation_radius_m=0.55, decay_per_m=10.0)


def cpu_ms(work: Callable[[], object], repeats: int) -> float:
    """Return the minimum CPU time over `repeats` calls [ms]."""
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return 1e3 * min(times)


def navfn_costmap(cells: NDArray[np.int8]) -> tuple[Costmap, float]:
    """Return the costmap on which the navfn paths were recorded, and the time to inflate it.

    In it an inflated cost replaces "unknown", so that unknown space near obstacles can be crossed.
    """
    known = np.maximum(cells, 0).astype(np.int8)
    grid = OccupancyGrid(cells=known, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    inflate = partial(build_costmap, grid, NO_HITS, ROS_FOOTPRINT, PEER_COSTS)
    costmap = inflate()
    costs = np.where((cells < 0) & (costmap.costs == 0), UNKNOWN, costmap.costs).astype(np.uint8)
    return replace(costmap, costs=costs), cpu_ms(inflate, 5)


def planner() -> None:
    """Plan between the pairs recorded with ROS navfn: time, and length relative to its Dijkstra path."""
    if not has_data(DATA):
        return
    print("planner: 50 pairs per map, unknown space blocked")
    known = TraversalCostOptions(allow_unknown=False)
    planners: dict[str, Planner] = {
        "navfn": NavfnPlanner(known),
        "navfn, unguided": NavfnPlanner(known, guided=False),
        "astar": AStarPlanner(known),
        "lattice": LatticePlanner(LatticeOptions(), known, ROS_FOOTPRINT),
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
            what = f"plan with {title} on {name.split('-')[0]}: {len(ratios)} of {len(pairs)} found, median"
            figure(what, f"{p50:.2f}", "ms", aim="" if title != "navfn" else f"<= {NAVFN_MS[name]}",
                   peers=f"navfn, Dijkstra to the goal {NAVFN_MS[name]}", source=SAME)  # fmt: skip
            figure(
                f"path length of {title} on {name.split('-')[0]}, mean",
                f"{np.mean(ratios):.3f}",
                "x that of navfn",
                aim="" if title != "navfn" else "1 +- 0.01",
            )
            print(
                f"    {title}: {len(ratios)}/{len(pairs)} found, {p50:.2f} ms (p95 {p95:.1f}), "
                f"length x {np.mean(ratios):.3f} of navfn"
            )


def costmap() -> None:
    """Measure the inflation of one window, and the update for one scan on maps of growing size."""
    if not has_data(DATA):
        return
    lethal = read_pgm(DATA / "oracle" / "inflation_in_120.pgm") == LETHAL
    cells = np.where(lethal, 100, 0).astype(np.int8)
    window = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    squared_distances(lethal, 11)
    distances_ms = cpu_ms(partial(squared_distances, lethal, 11), 50)
    whole_ms = cpu_ms(partial(build_costmap, window, NO_HITS, ROS_FOOTPRINT, PEER_COSTS), 50)
    print(f"costmap: inflation of 120 x 120: {whole_ms:.3f} ms, of it distances {distances_ms:.3f} ms")
    figure("inflation of a window, 120 x 120", f"{whole_ms:.3f}", "ms", aim="<= 0.25",
           peers="costmap_2d 0.36", source=SAME)  # fmt: skip
    rng = np.random.default_rng(0)
    angles_rad = np.linspace(-2.09, 2.09, 480)
    for side in (200, 400, 800, 1600, 3200):
        half_m = 0.025 * side
        cells = np.zeros((side, side), np.int8)
        layers, updates, rebuilds = CostmapLayers(Footprint(), PEER_COSTS), [], []
        for scan in range(20):
            range_m = 3.5 + 0.01 * rng.standard_normal((480, 1))
            hits_m = range_m * np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
            cols, rows = ((hits_m + half_m) / 0.05).astype(np.int64).T
            cells = cells.copy()
            cells[rows, cols] = 100
            grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-half_m, origin_y_m=-half_m)
            took_ms = cpu_ms(partial(layers.update, grid, hits_m), 1)
            if scan > 1:  # the first scans build everything
                updates.append(took_ms)
                rebuilds.append(cpu_ms(partial(build_costmap, grid, hits_m, Footprint(), PEER_COSTS), 1))
        if side in (200, 1600):
            figure(f"costmap update for a scan, map of {side} x {side}", f"{np.median(updates):.2f}", "ms")
        print(
            f"  map of {side} x {side}: update for a scan {np.median(updates):.2f} ms, "
            f"rebuild {np.median(rebuilds):.2f} ms"
        )


def window_request(name: str) -> ControlRequest:
    """Return a request in one of the recorded 6 m windows, with a path straight ahead."""
    lethal = read_pgm(DATA / "oracle" / f"costmap_{name}.pgm") == LETHAL
    cells = np.where(lethal, 100, 0).astype(np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    costmap = build_costmap(grid, NO_HITS, ROS_FOOTPRINT, PEER_COSTS)
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
    """Measure one controller cycle, with the default sampling and with 2020 x 20 as in the peers' table."""
    if not has_data(DATA):
        return
    print("rollouts: one DWA cycle (footprint check, path, goal and front terms)")
    for name in ("open", "median", "tight"):
        request = window_request(name)
        line = f"  {name}:"
        for v_samples, w_samples, horizon_s in ((7, 21, 1.7), (20, 101, 2.0)):
            options = DwaOptions(v_samples=v_samples, w_samples=w_samples, horizon_s=horizon_s)
            controller = DwaController(options, RotateInPlaceOptions(), SpeedLimits(), Footprint())
            controller.compute_command(request)
            work_ms = cpu_ms(partial(controller.compute_command, request), 20)
            line += f"  {v_samples * w_samples} x {round(horizon_s / 0.1)}: {1e3 * work_ms:.0f} us"
        mppi = MppiController(
            MppiOptions(futures=2000, steps=56), RotateInPlaceOptions(), SpeedLimits(), Footprint()
        )
        mppi.compute_command(request)
        mppi_ms = cpu_ms(partial(mppi.compute_command, request), 10)
        print(f"{line}  MPPI 2000 x 56: {1e3 * mppi_ms:.0f} us")
        figure(f"DWA cycle, 2020 x 20 steps, {name} window", f"{work_ms:.2f}", "ms", aim="<= 5",
               peers="ROS 1 critics 11.8 to 15.1", source=SAME)  # fmt: skip
        figure(f"MPPI cycle, 2000 x 56 steps, {name} window", f"{mppi_ms:.2f}", "ms", aim="<= 5",
               peers="Nav2: 2000 at 30 Hz, that is 33", source="Nav2's documentation, an i5")  # fmt: skip


def cycle() -> None:
    """Measure `Navigator.update` on a 10 m x 10 m map at 0.05 m, in a mission that maps as it drives."""
    room = KinematicWorld.from_boxes(box(0.8, 0.0, 4.8, 3.8), box(1.2, 0.1, 0.40, 0.30, 0.58))
    start, goal = Pose2(x_m=2.05, y_m=0.64, theta_rad=-2.56), Goal(x_m=0.38, y_m=-0.45)
    with timing(Navigator, "update") as times:
        for seed in range(6):
            drive(room, start, goal, (-4.2, -5.0, 10.0, 10.0), seed=seed)
            if seed == 0:
                times.clear()  # kernels were loaded in the first run
    p50, p99 = 1e3 * np.percentile(times, (50, 99))
    figure("update of the navigator, median / 99 %", f"{p50:.1f} / {p99:.1f}", "ms")
    print(f"cycle: {len(times)} updates, p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {1e3 * max(times):.2f} ms")


def loop() -> None:
    """Measure SLAM and navigation in the robot's loop, in the demo's missions with the real firmware.

    Navigation is all work of the drive manager in a control cycle, including the copy of the map. SLAM is the
    processing of telemetry and scans. Neither includes the time of the simulator.
    """
    with ExitStack() as stack:
        cycles = stack.enter_context(timing(DriveManager, "step"))
        odometry = stack.enter_context(timing(StateEstimator, "add_telemetry"))
        mapping = stack.enter_context(timing(StateEstimator, "add_scan"))
        driven_s = 0.0
        for seed in range(3):
            for mission in MISSIONS:
                outcome = drive_mission(mission, seed=seed, realtime=False, console=Console(quiet=True))
                if seed > 0:
                    driven_s += outcome.result.time_s
            if seed == 0:  # kernels were loaded
                for times in (cycles, odometry, mapping):
                    times.clear()
    print(f"loop: {driven_s:.0f} simulated s")
    slam = [a + b for a, b in zip_longest(odometry, mapping, fillvalue=0.0)]
    for name, times in (("navigation", cycles), ("SLAM", slam)):
        p50, p99 = 1e3 * np.percentile(times, (50, 99))
        ours = name == "navigation"
        figure(f"the robot's loop in the demo, {name}: median / 99 %", f"{p50:.1f} / {p99:.1f}", "ms",
               aim="- / <= 20" if ours else "")  # fmt: skip
        share = f"{100.0 * sum(times) / driven_s:.1f}"
        figure(f"the robot's loop in the demo, {name}: share of a core", share, "%",
               aim="<= 30 %" if ours else "", peers="move_base with costmaps 7 to 10 %" if ours else "",
               source="in the BARN worlds, not the demo" if ours else "")  # fmt: skip
        print(
            f"  {name}: p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {1e3 * max(times):.2f} ms, "
            f"{sum(times) / driven_s:.3f} core s per simulated s"
        )


@contextmanager
def timing(owner: type, name: str) -> Iterator[list[float]]:
    """Yield a list to which every call of a method appends its CPU time [s], inside the block."""
    original, times = getattr(owner, name), []

    def timed(*inputs: object, **named: object) -> object:
        start = time.thread_time()
        output = original(*inputs, **named)
        times.append(time.thread_time() - start)
        return output

    setattr(owner, name, timed)
    try:
        yield times
    finally:
        setattr(owner, name, original)


def main(arguments: list[str]) -> None:
    """Run the given parts, or all."""
    parts = {"planner": planner, "costmap": costmap, "rollouts": rollouts, "cycle": cycle, "loop": loop}
    for name in arguments or parts:
        parts[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
