"""Frontiers: where known free ground that the robot can reach borders on ground never seen.

Yamauchi, "A Frontier-Based Approach for Autonomous Exploration" (1997).
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label

from thumper.common.geometry import Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.dijkstra import dijkstra
from thumper.navigation.planners.start_and_goal_cells import nearest_open
from thumper.navigation.planners.traversal_cost import price_cells

EVERYWHERE = -1
NEIGHBOURS = np.ones((3, 3), np.bool_)
ROOM_M = 0.05  # beyond the outline's circle: there the robot turns with ease
SIGHT_M = 1.0  # from here, at most, a frontier is looked at
FACING_RAD = 1.0  # off its direction and the lidar still sees it
IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationOptions:
    """What is worth a drive."""

    # Frontiers shorter than this are left [m]; less maps every nook.
    least_frontier_m: Annotated[float, Gt(0)] = 0.40
    # How much nearer a frontier counts for each metre of its length [m/m].
    gain: Annotated[float, Ge(0)] = 1.0
    # How near to a frontier's middle is near enough [m].
    tolerance_m: Annotated[float, Gt(0)] = 0.30
    # Frontiers this near to one that was tried in vain, or visited, are left [m].
    done_radius_m: Annotated[float, Gt(0)] = 0.40
    # Price of the dearest inflated cell, in free cells.
    obstacle_weight: Annotated[float, Ge(0)] = 6.0
    # How far the search may begin from a robot that stands too near an obstacle [m].
    escape_radius_m: Annotated[float, Gt(0)] = 0.30


@dataclass(frozen=True, slots=True, kw_only=True)
class Frontier:
    """One border to the unknown."""

    x_m: float  # of its reachable cell nearest to its middle
    y_m: float
    view_m: tuple[float, float]  # where to look at it from: there the robot can turn, if anywhere near
    length_m: float
    way_m: float  # cost of the way there, in metres of free ground


def find_frontiers(
    grid: OccupancyGrid, map_from_base: Pose2, footprint: Footprint, options: ExplorationOptions
) -> list[Frontier]:
    """All frontiers that the robot can reach over known ground, best first."""
    costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
    prices = price_cells(costmap, options.obstacle_weight, None)
    row, col = grid.cell_of(map_from_base.x_m, map_from_base.y_m)
    start = nearest_open(prices, row, col, options.escape_radius_m / grid.resolution_m)
    if start is None:
        return []
    rows, cols = prices.shape
    way = dijkstra(prices, start[0] * cols + start[1], EVERYWHERE, False, 0.0).reshape(rows, cols)
    edges = np.isfinite(way) & binary_dilation(grid.cells < 0, NEIGHBOURS)
    parts, count = label(edges, NEIGHBOURS)
    circle_cells = (footprint.circumscribed_radius_m + ROOM_M) / grid.resolution_m
    roomy = np.argwhere(np.isfinite(way) & (costmap.squared_cells >= circle_cells**2))
    found = []
    for part in range(1, count + 1):
        cells = np.argwhere(parts == part)
        length_m = len(cells) * grid.resolution_m
        if length_m < options.least_frontier_m:
            continue
        middle = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1))]
        view = _view(costmap, roomy, middle)
        x_m, y_m = grid.centre_of(int(middle[0]), int(middle[1]))
        cost_m = float(way[view[0], view[1]]) * grid.resolution_m
        view_m = grid.centre_of(int(view[0]), int(view[1]))
        found.append(Frontier(x_m=x_m, y_m=y_m, view_m=view_m, length_m=length_m, way_m=cost_m))
    return sorted(found, key=lambda frontier: frontier.way_m - options.gain * frontier.length_m)


def _view(costmap: Costmap, roomy: IntArray, middle: IntArray) -> IntArray:
    """The roomy cell, shape (2,), nearest to a frontier's middle that sees it; without one, the middle.

    A frontier mostly ends in nooks. To drive into them takes long and to come out longer, and the lidar looks
    into them from outside.
    """
    away = np.hypot(*(roomy - middle).T)
    near = away <= SIGHT_M / costmap.resolution_m
    for cell in roomy[near][np.argsort(away[near])]:
        between = np.linspace(cell, middle, 2 * int(np.abs(cell - middle).max()) + 1)
        rows, cols = np.rint(between).astype(np.int64).T
        if not (costmap.costs[rows, cols] == LETHAL).any():
            return np.asarray(cell)
    return middle


class Explorer:
    """Chooses where to look next, and never the same place in vain twice."""

    def __init__(self, options: ExplorationOptions, footprint: Footprint) -> None:
        self._options = options
        self._footprint = footprint
        self._done_m: list[tuple[float, float]] = []

    def next_goal(self, grid: OccupancyGrid, map_from_base: Pose2) -> Goal | None:
        """The best frontier not yet tried, or None when the place is explored."""
        for frontier in find_frontiers(grid, map_from_base, self._footprint, self._options):
            spots = np.array(self._done_m).reshape(-1, 2)
            away_m = np.hypot(*(spots - (frontier.x_m, frontier.y_m)).T)
            if (away_m > self._options.done_radius_m).all():
                self._done_m.append((frontier.x_m, frontier.y_m))
                return self._goal(frontier)
        return None

    def _goal(self, frontier: Frontier) -> Goal:
        """The place to look from, and, when that is away from the frontier, toward it."""
        (x_m, y_m), tolerance_m = frontier.view_m, self._options.tolerance_m
        dx_m, dy_m = frontier.x_m - x_m, frontier.y_m - y_m
        if math.hypot(dx_m, dy_m) < tolerance_m:
            return Goal(x_m=x_m, y_m=y_m, tolerance_m=tolerance_m)
        return Goal(
            x_m=x_m,
            y_m=y_m,
            theta_rad=math.atan2(dy_m, dx_m),
            tolerance_m=tolerance_m,
            heading_tolerance_rad=FACING_RAD,
        )
