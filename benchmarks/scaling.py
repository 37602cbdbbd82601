"""How costs grow with the map: `python benchmarks/scaling.py [--check]`.

The robot is in a room of 8 m in the middle of maps of 200 x 200 to 4000 x 4000 cells, and its goal is 3 m
away. The exponent k in cost ~ side^k is fitted to the minimum CPU time of each size. With --check a row that
grows faster than stated ends with status 1.
"""

import argparse
import itertools
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from thumper.common.geometry import Pose2
from thumper.dashboard.page_state import PageState
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.layers import CostmapLayers
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.ros.codec import decode, encode
from thumper.ros.to_ros import Messages, map_change
from thumper.slam.grid.growing_grid import HitGrid

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.navigation import NO_HITS, cpu_ms

SIDES = (200, 400, 1000, 2000, 4000)
MESSAGES = Messages()
CELL_M, HALF_ROOM_CELLS = 0.05, 80
START, GOAL = Pose2(), Goal(x_m=3.0, y_m=0.0)
# The most that the exponent may be. Nothing may grow with the map; the memory it reads is further apart.
MOST = {"navfn": 0.3, "astar": 0.3, "lattice": 0.3, "costmap update": 0.3, "grid()": 0.3, "page packet": 0.3}


def room_map(side: int) -> OccupancyGrid:
    """Return a free map with a closed room round its middle, which is the origin."""
    cells = np.zeros((side, side), np.int8)
    low, high = side // 2 - HALF_ROOM_CELLS, side // 2 + HALF_ROOM_CELLS
    cells[low, low:high] = cells[high, low:high] = cells[low:high, low] = cells[low:high, high] = 100
    cells[side // 2 - 10 : side // 2 + 20, side // 2 + 30] = 100  # an obstacle on the way to the goal
    corner_m = -0.5 * CELL_M * side
    return OccupancyGrid(cells=cells, resolution_m=CELL_M, origin_x_m=corner_m, origin_y_m=corner_m)


class Robot:
    """A map, its costmap and scans that change cells in the whole room, as in the robot's loop."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self._random = np.random.default_rng(0)
        self._scan_m = self._random.uniform(-4.0, 4.0, (480, 2))
        self._hit_grid = HitGrid.from_counts(HitCounts.from_grid(grid), CELL_M, 0.5, 0.3)
        self._layers = CostmapLayers(Footprint(), CostmapOptions())
        self._grid = self._hit_grid.grid(percent=False)
        while self._layers.update(self._grid, self._scan_m) is None:
            pass  # a new map takes several calls
        times_s = itertools.count()
        self._page = PageState(Pose2(), lambda: float(next(times_s)))  # each tick is due
        self._map = MESSAGES.grid(0.0, self._grid)
        self._page.on_message("map", self._map)
        self._page.tick({})

    def scan(self) -> None:
        """Insert a scan; it is not part of what is measured."""
        self._scan_m = self._random.uniform(-4.0, 4.0, (480, 2))
        kinds, origins_m = np.full(480, HIT, np.uint8), np.zeros((480, 2))
        scan = ScanPoints(origins_m=origins_m, ends_m=self._scan_m, kinds=kinds)
        self._hit_grid.insert(START, scan)

    def render(self) -> None:
        """Return the map as the robot's loop asks for it."""
        self._grid = self._hit_grid.grid(percent=False)

    def update_costmap(self) -> None:
        """Update the costmap."""
        self._layers.update(self._grid, self._scan_m)

    def scan_and_render(self) -> None:
        """Insert a scan and render the map."""
        self.scan()
        self.render()

    def scan_and_publish(self) -> None:
        """Insert a scan, render the map and send to the page's server what has changed."""
        before, old = self._map, self._grid
        self.scan_and_render()
        self._map = MESSAGES.grid(0.0, self._grid)
        change = map_change(before, self._map, self._grid.changed_since(old.history))
        self._page.on_message("map_changes", decode(encode(change), change.__msgtype__))

    def make_packet(self) -> None:
        """Make the packet for all pages."""
        self._page.tick({})


def nothing() -> None:
    """Prepare nothing."""


def works(side: int) -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    """Return what precedes each measurement and what is measured in a map of this size."""
    grid, footprint, traversal = room_map(side), Footprint(), TraversalCostOptions()
    costmap = build_costmap(grid, NO_HITS, footprint, CostmapOptions())
    lattice = LatticePlanner(LatticeOptions(), traversal, footprint)
    planners: dict[str, Planner] = {
        "navfn": NavfnPlanner(traversal),
        "astar": AStarPlanner(traversal),
        "lattice": lattice,
    }
    robot = Robot(grid)
    return {
        **{
            name: (nothing, partial(planner.plan, costmap, START, GOAL)) for name, planner in planners.items()
        },
        "costmap update": (robot.scan_and_render, robot.update_costmap),
        "grid()": (robot.scan, robot.render),
        "page packet": (robot.scan_and_publish, robot.make_packet),
    }


def main() -> int:
    """Print and record the costs and exponents."""
    parser = argparse.ArgumentParser(description="growth of costs with the side of the map")
    parser.add_argument("--check", action="store_true", help="fail if a row grows faster than stated")
    check = parser.parse_args().check
    times_ms: dict[str, list[float]] = {name: [] for name in MOST}
    for side in SIDES:
        for name, (prepare, work) in works(side).items():
            measured = []
            for _ in range(10):
                prepare()
                measured.append(cpu_ms(work, 1))
            times_ms[name].append(min(measured[3:]))  # the first ones load kernels and take memory
    too_fast = []
    for name, most in MOST.items():
        exponent = float(np.polyfit(np.log(SIDES), np.log(times_ms[name]), 1)[0])
        row = " / ".join(f"{time_ms:.2f}" for time_ms in times_ms[name])
        print(f"{name:16} {row} ms, side^{exponent:.2f} (at most {most})")
        is_plan = name in {"navfn", "astar", "lattice"}
        what = "goal 3 m off" if is_plan else "after a scan"
        sides = " / ".join(map(str, SIDES))
        figure(f"{name}, {what}: side {sides} cells", row, "ms", aim="<= 2" if is_plan else "<= 1")
        figure(f"{name}, {what}: exponent of the side", f"{exponent:.2f}", aim=f"<= {most}")
        if exponent > most:
            too_fast.append(name)
    if check and too_fast:
        print(f"grows faster than stated: {', '.join(too_fast)}", file=sys.stderr)
    return 1 if check and too_fast else 0


if __name__ == "__main__":
    sys.exit(main())
