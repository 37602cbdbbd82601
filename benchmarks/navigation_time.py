"""Compare the time of missions with the ideal time, which is that of the shortest path at the highest speed.

Run: python benchmarks/navigation_time.py [--preset hard] [--houses 20] [--maps MAP.yaml ...] [--missions 10]

The robot has the map, and drives in the full simulator: across an open room, through random houses without
people, sills and table tops (one mission in each), and between random places of maps that others made. The
shortest path keeps the robot's middle off all walls by half its width. The last half metre counts until the
robot says that it has arrived. A route change passes some obstacle on another side; a flip returns to a side
left before. The time counts from the moment when the robot starts, 0.6 s before its first command.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.maps.map_server_io import load_map
from thumper.maps.occupancy_grid import FREE, OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.polyline import arc_lengths, index_at
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.courses.course import Course, CourseRun, drive_course
from thumper_hil.courses.route_changes import RouteChanges, count_route_changes
from thumper_hil.effects.preset import PRESETS
from thumper_hil.world.house import house_mission
from thumper_hil.world.world import World

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

LAST_M = 0.5
ROOM_M, APART_M, CLEAR_M = 0.32, 2.5, 0.6  # round start and goal; between them; of the open room's walls
ROOM = "[[wall]]\nclosed = true\npoints_m = [[-1.0, -4.0], [9.0, -4.0], [9.0, 4.0], [-1.0, 4.0]]\n"
LIMIT_S = 300.0
STANDING_M_S, TURNING_RAD_S, SLOW = 0.03, 0.15, 0.85  # the last is a part of the highest speed
AIMS = {"house": 1.15, "room": 1.1}

Place = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """A course and its shortest path."""

    name: str
    course: Course
    shortest_m: FloatArray  # the shortest path, shape (n, 2)
    obstacles_m: FloatArray  # shape (k, 2)

    @property
    def length_m(self) -> float:
        """The length of the shortest path."""
        return float(arc_lengths(self.shortest_m)[-1])

    def least_s(self, limits: SpeedLimits) -> float:
        """Return the time of a robot that turns toward the path, and then drives along it."""
        dx_m, dy_m = self.shortest_m[index_at(self.shortest_m, LAST_M)] - self.shortest_m[0]
        turn_rad = abs(wrap_angle(math.atan2(dy_m, dx_m) - self.course.start.theta_rad))
        return (
            limits.latency_s
            + _ramped_s(turn_rad, limits.w_max_rad_s, limits.w_accel_rad_s2)
            + _ramped_s(self.length_m, limits.v_max_m_s, limits.v_accel_m_s2)
        )


def _ramped_s(distance: float, speed: float, accel: float) -> float:
    """Return the time from standstill to standstill."""
    if distance < speed**2 / accel:
        return 2.0 * math.sqrt(distance / accel)
    return distance / speed + speed / accel


def shortest_path_m(grid: OccupancyGrid, start: Pose2, goal: Goal) -> FloatArray:
    """Return the shortest path, shape (n, 2)."""
    costmap = build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())
    planner = AStarPlanner(TraversalCostOptions(obstacle_weight=0.0, allow_unknown=False))
    path_m = planner.plan(costmap, start, goal).path_m
    assert path_m is not None
    return path_m


def mission(name: str, world: World, world_toml: str, start: Pose2, goal: Goal) -> Mission:
    """Return the mission through a world."""
    grid = world.to_grid()
    rows, cols = np.nonzero(grid.cells > 0)
    return Mission(
        name=name,
        course=Course(world_toml=world_toml, start=start, goal=goal, limit_s=LIMIT_S, has_map=True),
        shortest_m=shortest_path_m(grid, start, goal),
        obstacles_m=np.column_stack((cols + 0.5, rows + 0.5)) * grid.resolution_m
        + (grid.origin_x_m, grid.origin_y_m),
    )


def in_map(path: Path, count: int, rng: np.random.Generator) -> Iterator[Mission]:
    """Yield missions between random places of the largest free area of a map."""
    grid, world, toml = load_map(path), World.load(path), f'map = "{path.resolve()}"\n'
    room_m = distance_transform_edt(grid.cells == FREE) * grid.resolution_m
    parts, _ = label(room_m > ROOM_M)
    places = np.argwhere(parts == np.argmax(np.bincount(parts.ravel())[1:]) + 1)

    def draw() -> list[Place]:
        return [grid.centre_of(int(row), int(col)) for row, col in places[rng.integers(len(places), size=2)]]

    yield from between(draw, path.stem, world, toml, count, rng)


def in_room(folder: Path, count: int, rng: np.random.Generator) -> Iterator[Mission]:
    """Yield missions across an open room."""
    path = folder / "room.toml"
    path.write_text(ROOM, encoding="utf-8")

    def draw() -> list[Place]:
        x_m = rng.uniform(-1.0 + CLEAR_M, 9.0 - CLEAR_M, 2)
        y_m = rng.uniform(-4.0 + CLEAR_M, 4.0 - CLEAR_M, 2)
        return list(zip(x_m.tolist(), y_m.tolist(), strict=True))

    yield from between(draw, "room", World.load(path), ROOM, count, rng)


def between(
    draw: Callable[[], list[Place]], name: str, world: World, toml: str, count: int, rng: np.random.Generator
) -> Iterator[Mission]:
    """Yield missions from the first to the second place of a draw, if these are far enough apart."""
    made = 0
    while made < count:
        start_m, goal_m = draw()
        if math.dist(start_m, goal_m) < APART_M:
            continue
        made += 1
        start = Pose2(x_m=start_m[0], y_m=start_m[1], theta_rad=float(rng.uniform(-math.pi, math.pi)))
        yield mission(f"{name} {made}", world, toml, start, Goal(x_m=goal_m[0], y_m=goal_m[1]))


def in_houses(first: int, count: int) -> Iterator[Mission]:
    """Yield a mission in each house."""
    for number in range(first, first + count):
        house = house_mission(number)
        toml = "".join(
            f"[[wall]]\npoints_m = {[row[:2], row[2:]]}\n" for row in house.world.segments_m.tolist()
        ) + "".join(
            f"[[circle]]\nx_m = {x_m}\ny_m = {y_m}\nradius_m = {radius_m}\n"
            for x_m, y_m, radius_m in house.world.circles_m.tolist()
        )
        goal = Goal(x_m=house.goal_m[0], y_m=house.goal_m[1])
        yield mission(f"house {number}", house.world, toml, house.start, goal)


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """Where the time of a drive went."""

    ratio: float  # to the ideal time
    limited: float  # the same with the first turn and the limits of acceleration
    last_s: float  # from `LAST_M` before the goal
    driven: float  # length of the driven path, relative to the shortest
    standing: float  # fractions of the time: standing, ...
    turning: float  # ... turning in place, ...
    slow: float  # ... and driving at less than `SLOW` of the highest speed
    routes: RouteChanges


def times_of(mission: Mission, run: CourseRun, limits: SpeedLimits) -> Times:
    """Return where the time of a drive went."""
    time_s, x_m, y_m, theta_rad = run.track.T
    goal = mission.course.goal
    near = np.flatnonzero(np.hypot(x_m - goal.x_m, y_m - goal.y_m) <= LAST_M)
    step_s = np.diff(time_s)
    v_m_s = np.hypot(np.diff(x_m), np.diff(y_m)) / step_s
    w_rad_s = np.abs(np.diff(np.unwrap(theta_rad))) / step_s
    still = v_m_s < STANDING_M_S
    turning = (v_m_s < 0.1) & (w_rad_s >= TURNING_RAD_S)
    still &= ~turning
    slow = ~still & ~turning & (v_m_s < SLOW * limits.v_max_m_s)
    whole_s = float(step_s.sum())
    return Times(
        ratio=run.time_s * limits.v_max_m_s / mission.length_m,
        limited=run.time_s / mission.least_s(limits),
        last_s=float(time_s[-1] - time_s[near[0]]) if near.size else math.nan,
        driven=float(np.hypot(np.diff(x_m), np.diff(y_m)).sum()) / mission.length_m,
        standing=float(step_s[still].sum()) / whole_s,
        turning=float(step_s[turning].sum()) / whole_s,
        slow=float(step_s[slow].sum()) / whole_s,
        routes=count_route_changes(run.plans, mission.obstacles_m),
    )


def main() -> None:
    """Drive all missions and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--preset", choices=PRESETS, default="nominal")
    parser.add_argument("--houses", type=int, default=20, help="number of houses")
    parser.add_argument("--first", type=int, default=1, help="number of the first house")
    parser.add_argument("--missions", type=int, default=10, help="in the room and in each map")
    parser.add_argument("--maps", nargs="*", type=Path, default=[], help=".yaml files of maps")
    parser.add_argument("--seed", type=int, default=1, help="of the missions in room and maps")
    given = parser.parse_args()
    options = NavigationOptions()
    with TemporaryDirectory() as folder:
        kinds = [("room", in_room(Path(folder), given.missions, np.random.default_rng(given.seed)))]
        kinds += [("house", in_houses(given.first, given.houses))]
        kinds += [
            (path.stem, in_map(path, given.missions, np.random.default_rng(given.seed)))
            for path in given.maps
        ]
        for kind, missions in kinds:
            report(kind, list(missions), given.preset, options)


def report(kind: str, missions: list[Mission], preset: str, options: NavigationOptions) -> None:
    """Drive the missions of one kind and print their figures."""
    found = []
    for seed, one in enumerate(missions):
        run = drive_course(one.course, preset=preset, seed=seed, navigation=options)
        times = times_of(one, run, options.limits)
        print(
            f"    {one.name}: {one.length_m:.1f} m, {run.time_s:.1f} s, {times.ratio:.2f} x ideal, "
            f"{times.limited:.2f} with turn and ramps, driven "
            f"{times.driven:.2f}, standing {times.standing:.2f}, turning {times.turning:.2f}, slow "
            f"{times.slow:.2f}, last {times.last_s:.1f} s, flips {times.routes.flips}; {run.reason}",
            flush=True,
        )
        if run.reached and not run.contacts:
            found.append(times)
    if not missions:
        return
    name = f"time, {kind}, {preset}"
    figure(f"{name}: reached", f"{len(found)} of {len(missions)}")
    if not found:
        return
    ratios = [times.ratio for times in found]
    aim = AIMS.get(kind)
    figure(f"{name}: time / ideal, mean", f"{np.mean(ratios):.2f}", aim=f"<= {aim}" if aim else "")
    figure(f"{name}: time / ideal, median / worst", f"{np.median(ratios):.2f} / {max(ratios):.2f}")
    limited = [times.limited for times in found]
    figure(
        f"{name}: the same with first turn and ramps, mean / worst",
        f"{np.mean(limited):.2f} / {max(limited):.2f}",
    )
    last_s = [times.last_s for times in found]
    figure(
        f"{name}: last 0.5 m, median / worst",
        f"{np.median(last_s):.1f} / {max(last_s):.1f}",
        "s",
        aim="<= 2.0",
    )
    figure(
        f"{name}: route changes, flips per mission",
        " / ".join(
            f"{np.mean(counts):.2f}"
            for counts in ([t.routes.changes for t in found], [t.routes.flips for t in found])
        ),
    )
    for what in ("driven", "standing", "turning", "slow"):
        figure(f"{name}: {what}, mean", f"{np.mean([getattr(t, what) for t in found]):.2f}")


if __name__ == "__main__":
    main()
