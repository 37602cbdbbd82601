"""How long the navigator computes in one control cycle in a large map: `python benchmarks/large_map.py`.

The map covers 100 m x 100 m: 400 rooms of 5 m with doors. One goal is 60 m away through many rooms; the other
is in a room without a door, so that every search floods the map. CPU time of this thread, kernels loaded.
"""

import math
import sys
import time
from pathlib import Path

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper_hil.bench.hardware import BASE_FROM_LASER
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
BEAMS_RAD = np.radians(np.linspace(-120.0, 120.0, 341))
RANGE_M = 5.6


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


def main() -> None:
    """Print the times of both drives."""
    grid = rooms()
    drive(grid, GOALS["a goal 60 m away"])  # loads the kernels
    for name, goal in GOALS.items():
        times_ms, state = drive(grid, goal)
        p50, p99, most = np.percentile(times_ms, (50, 99, 99.9))
        print(f"{name}: {len(times_ms)} cycles, {state.value}; longest {max(times_ms):.1f} ms")
        what = f"navigator in 100 m x 100 m, {name}: median / 99 % / 99.9 %"
        figure(what, f"{p50:.1f} / {p99:.1f} / {most:.1f}", "ms", aim=f"- / - / <= {AIM_MS}")


if __name__ == "__main__":
    main()
