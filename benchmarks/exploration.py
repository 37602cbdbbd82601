"""Measure how far a robot drives to explore, beside a tour that knows the map.

Run: python benchmarks/exploration.py [--houses 20] [--first 1] [--maps MAP.yaml ...]

Only the choice of frontiers is simulated: a robot with the lidar's field of view moves along the planned
paths, without noise, until no frontier is left, and then home. The tour that knows the map visits places from
which a lidar sees all the ground that the exploring robot saw; it is not the shortest one, but near it.
"""

import argparse
import math
import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import run_to_end
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.dijkstra import dijkstra
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer, Frontier
from thumper.navigation.planners.polyline import resample
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, traversal_cost
from thumper_hil.world.house import house_mission
from thumper_hil.world.world import World

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

STEP_M, LOOK_STEPS = 0.1, 5  # of the motion; between two plans
BEAMS = 480
PLACES_M = 0.5  # between the places of the tour
STARTS = 10  # random orders that are improved
LEAST_GAIN_M2 = 0.25  # a place that sees less than this is not worth a visit
MAX_LEGS = 2000


class Robot:
    """Moves in a world and maps what its lidar sees."""

    def __init__(self, world: World, start: Pose2) -> None:
        self.world, self.pose, self.driven_m = world, start, 0.0
        self.view, self.footprint = FieldOfView(), Footprint()
        self.truth = world.to_grid()
        self.seen = np.zeros(self.truth.cells.size, np.bool_)
        self.planner = AStarPlanner(TraversalCostOptions(allow_unknown=False))
        self.look()

    def look(self) -> None:
        """Add a scan to the map."""
        laser = self.pose @ self.view.base_from_laser
        angles_rad = laser.theta_rad + np.linspace(-0.5, 0.5, BEAMS) * self.view.opening_rad
        self.seen |= seen_from(self.world, self.truth, (laser.x_m, laser.y_m), angles_rad, self.view.range_m)

    def grid(self) -> OccupancyGrid:
        """Return the map so far."""
        cells = np.where(self.seen.reshape(self.truth.cells.shape), self.truth.cells, UNKNOWN)
        return replace(self.truth, cells=cells.astype(np.int8))

    def drive(self, goal: Goal, frontier: Frontier | None) -> bool:
        """Drive until the frontier has been seen, or to the goal; return whether there is a path."""
        while True:
            costmap = build_costmap(self.grid(), np.empty((0, 2)), self.footprint, CostmapOptions())
            path_m = self.planner.plan(costmap, self.pose, goal).path_m
            if path_m is None:
                return False
            path_m = resample(path_m, STEP_M)
            for here, there in pairwise(path_m[: 1 + LOOK_STEPS]):
                step_m = there - here
                self.driven_m += math.hypot(*step_m)
                self._stand(there, math.atan2(step_m[1], step_m[0]))
            if frontier is not None and frontier.is_seen(self.grid()):
                return True
            if len(path_m) <= 1 + LOOK_STEPS:
                if goal.theta_rad is not None:
                    self._stand(path_m[-1], goal.theta_rad)
                return True

    def _stand(self, place_m: FloatArray, theta_rad: float) -> None:
        self.pose = Pose2(x_m=float(place_m[0]), y_m=float(place_m[1]), theta_rad=theta_rad)
        self.look()


def explore(world: World, start: Pose2, options: ExplorationOptions) -> Robot:
    """Return the robot when it has explored a world and driven home."""
    robot = Robot(world, start)
    explorer = Explorer(options, robot.footprint)
    missed: list[Frontier] | None = []
    for _ in range(MAX_LEGS):
        frontier = run_to_end(explorer.search(robot.grid(), robot.pose))
        if frontier is None and missed:
            explorer.retry(missed)  # once
            missed = None
            continue
        if frontier is None:
            break
        if not robot.drive(explorer.goal(frontier), frontier) or not frontier.is_seen(robot.grid()):
            explorer.skip(frontier)
            if missed is not None:
                missed.append(frontier)
    robot.drive(Goal(x_m=start.x_m, y_m=start.y_m), None)
    return robot


def known_tour_m(world: World, start: Pose2, grid: OccupancyGrid) -> float:
    """Return the length of a tour of places that see all free cells of an explored map."""
    footprint, view = Footprint(), FieldOfView()
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
    ground = traversal_cost(costmap, TraversalCostOptions(obstacle_weight=0.0, allow_unknown=False))
    cols = grid.cells.shape[1]
    row, col = grid.cell_of(start.x_m, start.y_m)
    reached = dijkstra(ground, row * cols + col, -1, False, 0.0).reshape(grid.cells.shape)
    every = round(PLACES_M / grid.resolution_m)
    roomy = np.zeros(grid.cells.shape, np.bool_)
    roomy[::every, ::every] = True
    places = [(row, col), *map(tuple, np.argwhere(roomy & np.isfinite(reached)))]
    around_rad = np.linspace(-math.pi, math.pi, 720, endpoint=False)
    seen = [
        seen_from(world, grid, grid.centre_of(int(row), int(col)), around_rad, view.range_m)
        for row, col in places
    ]
    missing = np.bitwise_or.reduce(seen) & (grid.cells.ravel() == 0)
    missing &= ~seen[0]
    chosen = [0]
    while missing.any():
        gains = [int((cells & missing).sum()) for cells in seen]
        best = int(np.argmax(gains))
        if gains[best] * grid.resolution_m**2 < LEAST_GAIN_M2:
            break
        chosen.append(best)
        missing &= ~seen[best]
    flat = [places[index][0] * cols + places[index][1] for index in chosen]
    apart_m = np.array([dijkstra(ground, cell, -1, False, 0.0)[flat] for cell in flat]) * grid.resolution_m
    return min(_tour_m(apart_m, np.random.default_rng(seed)) for seed in range(STARTS))


def seen_from(
    world: World, grid: OccupancyGrid, place_m: tuple[float, float], angles_rad: FloatArray, range_m: float
) -> NDArray[np.bool_]:
    """Return which cells, flat, the beams of a lidar at a place see."""
    ranges_m = np.minimum(world.cast(*place_m, angles_rad) + 0.5 * grid.resolution_m, range_m)
    along_m = np.arange(0.0, range_m, 0.5 * grid.resolution_m)
    angle, step = np.nonzero(along_m < ranges_m[:, None])
    x_m = place_m[0] + along_m[step] * np.cos(angles_rad[angle])
    y_m = place_m[1] + along_m[step] * np.sin(angles_rad[angle])
    rows = np.floor((y_m - grid.origin_y_m) / grid.resolution_m).astype(np.int64)
    cols = np.floor((x_m - grid.origin_x_m) / grid.resolution_m).astype(np.int64)
    inside = (rows >= 0) & (cols >= 0) & (rows < grid.cells.shape[0]) & (cols < grid.cells.shape[1])
    seen = np.zeros(grid.cells.size, np.bool_)
    seen[rows[inside] * grid.cells.shape[1] + cols[inside]] = True
    return seen


def _tour_m(apart_m: FloatArray, rng: np.random.Generator) -> float:
    """Return the length of a closed tour of all places, improved by 2-opt from a random order."""
    order = np.concatenate(((0,), 1 + rng.permutation(len(apart_m) - 1)))
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order) + 1):
                after = order[j % len(order)]
                before_m = apart_m[order[i - 1], order[i]] + apart_m[order[j - 1], after]
                if apart_m[order[i - 1], order[j - 1]] + apart_m[order[i], after] < before_m - 1e-6:
                    order[i:j] = order[i:j][::-1]
                    improved = True
    return float(apart_m[order, np.roll(order, -1)].sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A world to explore."""

    name: str
    world: World
    start: Pose2


def main() -> None:
    """Explore all worlds and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--houses", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--maps", nargs="*", default=[], help="MAP.yaml:X:Y, with the place of the start")
    parser.add_argument("--no-tour", action="store_true")
    given = parser.parse_args()
    places = []
    for number in range(given.first, given.first + given.houses):
        house = house_mission(number)
        places.append(Place(name=f"house {number}", world=house.world, start=house.start))
    for text in given.maps:
        path, x_m, y_m = text.split(":")
        places.append(
            Place(name=Path(path).stem, world=World.load(path), start=Pose2(x_m=float(x_m), y_m=float(y_m)))
        )
    driven_m, ratios = [], []
    for place in places:
        robot = explore(place.world, place.start, ExplorationOptions())
        grid = robot.grid()
        tour_m = math.nan if given.no_tour else known_tour_m(place.world, place.start, grid)
        area_m2 = float((grid.cells == 0).sum()) * grid.resolution_m**2
        print(
            f"    {place.name}: {robot.driven_m:.1f} m, tour {tour_m:.1f} m, "
            f"{robot.driven_m / max(tour_m, 0.1):.2f}, {area_m2:.1f} m²",
            flush=True,
        )
        driven_m.append(robot.driven_m)
        ratios.append(robot.driven_m / tour_m)
    figure("exploration: path, sum", f"{sum(driven_m):.1f}", "m")
    figure(
        "exploration: path / tour that knows the map, mean / worst",
        f"{np.mean(ratios):.2f} / {max(ratios):.2f}",
    )


if __name__ == "__main__":
    main()
