"""How long a cycle computes in a large map: `python benchmarks/large_map.py [navigator] [searches] [loop]`.

The map covers 100 m x 100 m: 400 rooms of 5 m with doors. One goal is 60 m away through many rooms; the other
is in a room without a door, so that every search floods the map. CPU time of this thread, kernels loaded.

`navigator` calls the navigator alone. `searches` are the two that go on over many cycles: for the next
frontier, with a third of the rooms unknown, and for the robot's pose. `loop` drives the whole robot with its
firmware under `hard`, to goals 42 m away: four times the CPU time of the host passes in the simulation, as if
it had a quarter of the core.
"""

import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlencode

import numpy as np

from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.resumable import SlicedSearch, merged
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer, Frontier
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.exploration import SLICES_PER_CYCLE
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.slam.localization.amcl import Amcl
from thumper_hil.bench.hardware import BASE_FROM_LASER
from thumper_hil.bench.registry import forget_simulation, simulation
from thumper_hil.effects.preset import load_preset
from thumper_hil.kinematic.world import KinematicWorld

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

CELL_M, ROOM_CELLS, ROOMS, DOOR_CELLS = 0.05, 100, 20, 24
SIDE = ROOM_CELLS * ROOMS + 1
CLOSED = (14, 16)  # row and column of the room without a door
PERIOD_S, LIMIT_S, AIM_MS = 0.1, 60.0, 25
START = Pose2(x_m=12.5, y_m=12.5)
GOALS = {
    "a goal 60 m away": Goal(x_m=62.5, y_m=47.5),
    "a goal in a closed room": Goal(x_m=(CLOSED[1] + 0.5) * 5.0, y_m=(CLOSED[0] + 0.5) * 5.0),
}
MIDDLE = Pose2(x_m=52.5, y_m=42.5)
LOOP_GOALS = {
    "a goal 42 m away": Goal(x_m=22.5, y_m=12.5),
    "a goal in a closed room": GOALS["a goal in a closed room"],
}
BEAMS_RAD = np.radians(np.linspace(-120.0, 120.0, 341))
RANGE_M = 5.6
SEARCH_SCANS = 300


def rooms() -> OccupancyGrid:
    """Return the map: each room has doors to its four neighbours, at random places."""
    rng = np.random.default_rng(1)
    cells = np.zeros((SIDE, SIDE), np.int8)
    cells[::ROOM_CELLS], cells[:, ::ROOM_CELLS] = 100, 100
    for row in range(ROOMS):
        for column in range(ROOMS - 1):  # the wall right of a room, and by symmetry the one above another
            wall = (column + 1) * ROOM_CELLS
            right, above = row * ROOM_CELLS + rng.integers(10, ROOM_CELLS - DOOR_CELLS - 10, 2)
            if CLOSED not in {(row, column), (row, column + 1)}:
                cells[right : right + DOOR_CELLS, wall] = 0
            if CLOSED not in {(column, row), (column + 1, row)}:
                cells[wall, above : above + DOOR_CELLS] = 0
    return OccupancyGrid(cells=cells, resolution_m=CELL_M, origin_x_m=0.0, origin_y_m=0.0)


def walls_near(grid: OccupancyGrid, pose: Pose2) -> KinematicWorld:
    """Return the walls round a pose as posts of the size of a cell."""
    reach = math.ceil(RANGE_M / CELL_M) + 2
    row, column = grid.cell_of(pose.x_m, pose.y_m)
    top, left = max(0, row - reach), max(0, column - reach)
    found = np.argwhere(grid.cells[top : row + reach, left : column + reach] == 100)
    centres_m = (found[:, ::-1] + (left, top) + 0.5) * CELL_M
    return KinematicWorld(circles_m=np.column_stack((centres_m, np.full(len(found), 0.5 * CELL_M))))


def hits_m(world: KinematicWorld, pose: Pose2) -> FloatArray:
    """Return the hits of a scan in the map, shape (n, 2)."""
    laser = pose @ BASE_FROM_LASER
    ranges_m = world.cast(laser, BEAMS_RAD, RANGE_M)
    seen = np.isfinite(ranges_m)
    ends_m = ranges_m[seen, None] * np.column_stack((np.cos(BEAMS_RAD[seen]), np.sin(BEAMS_RAD[seen])))
    return laser.apply(ends_m)


def drive(grid: OccupancyGrid, goal: Goal) -> tuple[list[float], NavigationState]:
    """Drive toward a goal for up to `LIMIT_S`; return the CPU time of each cycle [ms], and how it ended."""
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(goal)
    pose, command, times_ms = START, Twist2(), list[float]()
    world = walls_near(grid, pose)
    for cycle in range(round(LIMIT_S / PERIOD_S)):
        if cycle % 20 == 0:
            world = walls_near(grid, pose)
        hits = hits_m(world, pose)
        begin_s = time.thread_time()
        output = navigator.update(cycle * PERIOD_S, pose, command, grid, hits)
        times_ms.append(1e3 * (time.thread_time() - begin_s))
        if output.state in {NavigationState.REACHED, NavigationState.FAILED}:
            break
        command = output.command
        pose = pose @ Pose2(x_m=command.v_m_s * PERIOD_S, theta_rad=command.w_rad_s * PERIOD_S)
    return times_ms, output.state


def frontier_search(grid: OccupancyGrid) -> list[float]:
    """Search the next frontier with a third of the rooms unknown; return the CPU time of each cycle [ms]."""
    cells, rng = grid.cells.copy(), np.random.default_rng(2)
    for row, column in np.argwhere(rng.random((ROOMS, ROOMS)) < 1 / 3):
        if (row, column) != (int(MIDDLE.y_m // 5.0), int(MIDDLE.x_m // 5.0)):
            corner = row * ROOM_CELLS + 1, column * ROOM_CELLS + 1
            cells[corner[0] : corner[0] + ROOM_CELLS - 1, corner[1] : corner[1] + ROOM_CELLS - 1] = -1
    search, times_ms = SlicedSearch[Frontier | None](), list[float]()
    explorer = Explorer(ExplorationOptions(), Footprint())
    search.start(merged(explorer.search(replace(grid, cells=cells), MIDDLE), SLICES_PER_CYCLE))
    while search.is_running:
        begin_s = time.thread_time()
        search.advance()
        times_ms.append(1e3 * (time.thread_time() - begin_s))
    return times_ms


def pose_search(grid: OccupancyGrid) -> list[float]:
    """Search the pose in the whole map, at rest; return the CPU time of each scan [ms]."""
    localizer = Amcl(grid, base_from_laser=BASE_FROM_LASER)
    ranges_m = walls_near(grid, MIDDLE).cast(MIDDLE @ BASE_FROM_LASER, BEAMS_RAD, RANGE_M)
    step_rad, times_ms = float(BEAMS_RAD[1] - BEAMS_RAD[0]), list[float]()
    for number in range(SEARCH_SCANS):
        scan = Scan(
            time_s=PERIOD_S * number,
            ranges_m=ranges_m,
            angle_min_rad=float(BEAMS_RAD[0]),
            angle_increment_rad=step_rad,
        )
        begin_s = time.thread_time()
        localizer.update(Pose2(), scan, Twist2())
        times_ms.append(1e3 * (time.thread_time() - begin_s))
        if not localizer.quality().lost:
            break
    return times_ms


def walls_toml(grid: OccupancyGrid) -> str:
    """Return the walls of the map as a world."""
    lines = []
    for across in (False, True):
        for k in range(0, SIDE, ROOM_CELLS):
            is_wall = (grid.cells[:, k] if across else grid.cells[k]) == 100
            edges = np.flatnonzero(np.diff(np.concatenate(([0], is_wall.astype(np.int8), [0]))))
            for first, end in edges.reshape(-1, 2):
                if end - first > 1:  # one cell is a wall that crosses this line
                    along_m, at_m = ((first + 0.5) * CELL_M, (end - 0.5) * CELL_M), (k + 0.5) * CELL_M
                    ends_m = [[at_m, a_m] if across else [a_m, at_m] for a_m in along_m]
                    lines.append(f"[[wall]]\npoints_m = {np.array(ends_m).tolist()}\n")
    return "".join(lines)


def drive_robot(grid: OccupancyGrid, goal: Goal) -> tuple[list[float], list[float], str]:
    """Drive the whole robot; return the CPU time [ms] and period [s] of each cycle, and how it ended."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "rooms.toml"
        path.write_text(walls_toml(grid), encoding="utf-8")
        place = {"world": path, "x_m": MIDDLE.x_m, "y_m": MIDDLE.y_m, "preset": "hard"}
        config = RobotConfig(
            board=BoardOptions(port=f"sim://large/board?{urlencode(place)}"),
            lidar=LidarOptions(port="sim://large/lidar"),
        )
        cycles = list[tuple[float, float]]()
        with open_robot(config, MIDDLE, grid) as robot:
            bench, factor = simulation("large"), load_preset("hard").host.cpu_factor
            robot.after_cycle.append(lambda: cycles.append((bench.time_s, bench.host.charged_s)))
            try:
                reason = robot.run(drive_to_goal(goal, "large")).reason
            except ThumperError as refusal:
                reason = str(refusal)
    forget_simulation("large")
    periods_s, charges_s = np.diff(cycles, axis=0).T
    return list(1e3 * charges_s / factor), list(periods_s), reason


SEARCHES = {"for the next frontier": frontier_search, "for the pose": pose_search}


def show(part: str, name: str, times_ms: list[float], ending: str) -> None:
    """Print how long the cycles of one part took."""
    p50, p99, most = np.percentile(times_ms, (50, 99, 99.9))
    print(f"{name}: {len(times_ms)} cycles{ending}; longest {max(times_ms):.1f} ms")
    what = f"{part} in 100 m x 100 m, {name}: median / 99 % / 99.9 %"
    figure(what, f"{p50:.1f} / {p99:.1f} / {most:.1f}", "ms", aim=f"- / - / <= {AIM_MS}")


def main() -> None:
    """Print the times of the drives."""
    parts = sys.argv[1:] or ["navigator", "searches", "loop"]
    grid = rooms()
    for name, goal in LOOP_GOALS.items() if "loop" in parts else ():
        times_ms, periods_s, reason = drive_robot(grid, goal)
        show("whole loop", name, times_ms, f", {reason}; longest period {max(periods_s):.2f} s")
        late = np.mean(np.array(periods_s) > 2 * PERIOD_S)
        figure(f"the same under hard: cycles that lose a scan, {name}", f"{100 * late:.2f}", "%")
    for name, search in SEARCHES.items() if "searches" in parts else ():
        search(grid)  # loads the kernels
        show("search", name, search(grid), "")
    if "navigator" not in parts:
        return
    drive(grid, GOALS["a goal 60 m away"])  # loads the kernels
    for name, goal in GOALS.items():
        times_ms, state = drive(grid, goal)
        show("navigator", name, times_ms, f", {state.value}")


if __name__ == "__main__":
    main()
