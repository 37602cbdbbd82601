"""Frontiers: where reachable free space borders on unknown space.

Yamauchi, "A Frontier-Based Approach for Autonomous Exploration" (1997).
"""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, bands_of, merged, run_to_end
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid
from thumper.navigation.costmap.bands import search_costmap
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.cell_costs import CostArray
from thumper.navigation.planners.dijkstra import search_dijkstra
from thumper.navigation.planners.start_and_goal_cells import nearest_passable
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, traversal_cost

EVERYWHERE = -1
TINY = 1e-9
STEPS_PER_SLICE = 50  # of borders and lines of sight: about 5 ms
EDGES_PER_SLICE = 20_000  # more edge cells than this are grouped in several slices
TURNING_ROOM_M = 0.05  # beyond the circumscribed circle: there the robot rotates easily
VIEW_DISTANCE_M = 1.0  # a frontier is observed from at most this far
FACING_RAD = 1.0  # this far off the frontier's direction the lidar still sees it
NEIGHBOURS = [(row, col) for row in (-1, 0, 1) for col in (-1, 0, 1) if row or col]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationOptions:
    """Which frontiers to visit."""

    # Frontiers shorter than this are skipped [m]; less maps every recess.
    least_frontier_m: Annotated[float, Gt(0)] = 0.40
    # Preference for long frontiers: metres of path that one metre of frontier is worth [m/m].
    gain: Annotated[float, Ge(0)] = 1.0
    # Goal tolerance at a frontier [m].
    tolerance_m: Annotated[float, Gt(0)] = 0.30
    # Frontiers this near to a visited or unreachable one are skipped [m].
    done_radius_m: Annotated[float, Gt(0)] = 0.40
    # Extra cost of the most expensive inflated cell, in free cells.
    obstacle_weight: Annotated[float, Ge(0)] = 6.0
    # How far from the robot the search may start if the robot is too close to an obstacle [m].
    escape_radius_m: Annotated[float, Gt(0)] = 0.30


@dataclass(frozen=True, slots=True, kw_only=True)
class Frontier:
    """One border to unknown space."""

    x_m: float  # of its reachable cell nearest to its middle
    y_m: float
    viewpoint_m: tuple[float, float]  # from where to observe it: a place to turn, if there is one near
    length_m: float
    path_cost_m: float  # cost of the path to the viewpoint, in metres of free space
    border_m: FloatArray = field(compare=False, default_factory=lambda: np.empty((0, 2)))  # x, y of its cells

    def is_seen(self, grid: OccupancyGrid) -> bool:
        """Return whether less than half of its cells still border on unknown space."""
        rows, cols = grid.cells.shape
        cells = np.floor((self.border_m - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m)
        col, row = cells.astype(np.int64).T
        beside_unknown = np.zeros(len(row), np.bool_)
        for step_row, step_col in NEIGHBOURS:
            near_row = np.clip(row + step_row, 0, rows - 1)
            near_col = np.clip(col + step_col, 0, cols - 1)
            beside_unknown |= grid.cells[near_row, near_col] < 0
        return int(beside_unknown.sum()) * 2 < len(row)


def search_frontiers(
    grid: OccupancyGrid, map_from_base: Pose2, footprint: Footprint, options: ExplorationOptions
) -> Search[list[Frontier]]:
    """Return all frontiers that the robot can reach through known space, best first.

    The grid must not change until the search has ended.
    """
    costmap = yield from search_costmap(grid, footprint, CostmapOptions())
    known = TraversalCostOptions(obstacle_weight=options.obstacle_weight, allow_unknown=False)
    cells = traversal_cost(costmap, known)
    row, col = grid.cell_of(map_from_base.x_m, map_from_base.y_m)
    start = nearest_passable(cells, row, col, options.escape_radius_m / grid.resolution_m)
    if start is None:
        return []
    rows, cols = grid.cells.shape
    flat_costs = yield from search_dijkstra(cells, start[0] * cols + start[1], EVERYWHERE, False, 0.0)
    path_costs = flat_costs.reshape(rows, cols)
    edges = yield from _edges(path_costs, grid.cells)
    borders = yield from _borders(edges, cols, math.ceil(options.least_frontier_m / grid.resolution_m - TINY))
    found = yield from merged(_frontiers(borders, grid, costmap, path_costs, footprint), STEPS_PER_SLICE)
    return sorted(found, key=lambda frontier: frontier.path_cost_m - options.gain * frontier.length_m)


def find_frontiers(
    grid: OccupancyGrid, map_from_base: Pose2, footprint: Footprint, options: ExplorationOptions
) -> list[Frontier]:
    """Run `search_frontiers` at once."""
    return run_to_end(search_frontiers(grid, map_from_base, footprint, options))


def _edges(path_costs: CostArray, cells: CellArray) -> Search[IntArray]:
    """Return the reached cells beside unknown ones in the order of rows, flat indices, shape (n,)."""
    found = []
    for rows in bands_of(cells.shape):
        if rows.start > 0:
            yield
        top = max(0, rows.start - 1)
        beside = cells[top : rows.stop + 1] < 0
        for axis in (0, 1):
            before, after = ([slice(None)] * 2 for _ in range(2))
            before[axis], after[axis] = slice(None, -1), slice(1, None)
            row_or_column = beside.copy()
            beside[tuple(before)] |= row_or_column[tuple(after)]
            beside[tuple(after)] |= row_or_column[tuple(before)]
        inner = beside[rows.start - top : rows.stop - top] & (path_costs[rows] > 0.0)
        found.append(np.flatnonzero(inner) + rows.start * cells.shape[1])
    return np.concatenate(found)


def connected_components(count: int, first: IntArray, second: IntArray) -> IntArray:
    """Return the number of the component of each of `count` nodes, shape (count,), by the least node in each.

    `first` and `second`, shape (n,), are the ends of the links. Each round links trees of nodes and flattens
    them (Shiloach and Vishkin, "An O(log n) parallel connectivity algorithm", 1982). scipy does the same, but
    loading it takes 22 MB.
    """
    root = np.arange(count)
    while (apart := root[first] != root[second]).any():
        one, other = root[first[apart]], root[second[apart]]
        np.minimum.at(root, np.maximum(one, other), np.minimum(one, other))
        while (root[root] != root).any():
            root = root[root]
    return np.unique(root, return_inverse=True)[1]


def _borders(edges: IntArray, cols: int, least_cells: int) -> Search[list[IntArray]]:
    """Return the connected groups of at least `least_cells` edge cells, shape (n, 2) each: row, column.

    The work grows with the number of edge cells, not with the map. No edge cell is in the map's last column.
    """
    if not len(edges):
        return []
    pairs = []
    for step in (1, cols - 1, cols, cols + 1):  # the other four neighbours have this one as theirs
        at = np.searchsorted(edges, edges + step)
        meets = np.flatnonzero(edges[np.minimum(at, len(edges) - 1)] == edges + step)
        pairs.append(np.stack((meets, at[meets])))
        if len(edges) > EDGES_PER_SLICE:
            yield
    first, second = np.concatenate(pairs, axis=1)
    numbers = connected_components(len(edges), first, second)
    if len(edges) > EDGES_PER_SLICE:
        yield
    counts = np.bincount(numbers)
    large = np.flatnonzero(counts[numbers] >= least_cells)
    large = large[np.argsort(numbers[large], kind="stable")]
    ends = np.cumsum(counts[counts >= least_cells])
    row_col = np.stack(np.divmod(edges[large], cols), axis=1)
    return np.split(row_col, ends[:-1]) if len(ends) else []


def _frontiers(
    borders: list[IntArray],
    grid: OccupancyGrid,
    costmap: Costmap,
    path_costs: CostArray,
    footprint: Footprint,
) -> Search[list[Frontier]]:
    """Return a frontier for each border; a step is one border or one line of sight."""
    circle_cells = (footprint.circumscribed_radius_m + TURNING_ROOM_M) / grid.resolution_m
    found = []
    for cells in borders:
        middle = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1))]
        view = yield from _viewpoint(costmap, path_costs, middle, circle_cells)
        x_m, y_m = grid.centre_of(int(middle[0]), int(middle[1]))
        found.append(
            Frontier(
                x_m=x_m,
                y_m=y_m,
                viewpoint_m=grid.centre_of(int(view[0]), int(view[1])),
                length_m=len(cells) * grid.resolution_m,
                path_cost_m=float(path_costs[view[0], view[1]]) * grid.resolution_m,
                border_m=np.array((grid.origin_x_m, grid.origin_y_m))
                + (cells[:, ::-1] + 0.5) * grid.resolution_m,
            )
        )
    return found


def _viewpoint(
    costmap: Costmap, path_costs: CostArray, middle: IntArray, circle_cells: float
) -> Search[IntArray]:
    """Return the reached cell with room to turn, shape (2,), nearest to a frontier's middle that sees it.

    Most frontiers end in recesses. Driving into them takes long, and driving out takes longer; the lidar sees
    into them from outside. Without such a cell it is the middle itself. A step is one line of sight.
    """
    reach = int(VIEW_DISTANCE_M / costmap.resolution_m)
    corner = np.maximum(middle - reach, 0)
    part = tuple(slice(lo, hi + reach + 1) for lo, hi in zip(corner, middle, strict=True))
    roomy = (path_costs[part] > 0.0) & (costmap.squared_cells[part] >= circle_cells**2)
    candidates = np.argwhere(roomy) + corner
    distances = np.hypot(*(candidates - middle).T)
    near = distances <= VIEW_DISTANCE_M / costmap.resolution_m
    yield
    for cell in candidates[near][np.argsort(distances[near], kind="stable")]:
        if _sees(costmap, cell, middle):
            return np.asarray(cell)
        yield
    return middle


def _sees(costmap: Costmap, cell: IntArray, other: IntArray) -> bool:
    """Return whether no obstacle is between two cells, shape (2,)."""
    between = np.linspace(cell, other, 2 * int(np.abs(cell - other).max()) + 1)
    rows, cols = np.rint(between).astype(np.int64).T
    return not (costmap.costs[rows, cols] == LETHAL).any()


class Explorer:
    """Chooses the next frontier, and remembers those to skip."""

    def __init__(self, options: ExplorationOptions, footprint: Footprint) -> None:
        self._options = options
        self._footprint = footprint
        self._skipped_m: list[tuple[float, float]] = []

    def search(self, grid: OccupancyGrid, map_from_base: Pose2) -> Search[Frontier | None]:
        """Return the best frontier that is not skipped, or None when the place is explored."""
        found = yield from search_frontiers(grid, map_from_base, self._footprint, self._options)
        skipped = np.array(self._skipped_m).reshape(-1, 2)
        for frontier in found:
            distances_m = np.hypot(*(skipped - (frontier.x_m, frontier.y_m)).T)
            if (distances_m > self._options.done_radius_m).all():
                return frontier
        return None

    def skip(self, frontier: Frontier) -> None:
        """Choose nothing near this frontier again: it was visited, or cannot be reached."""
        self._skipped_m.append((frontier.x_m, frontier.y_m))

    def retry(self, frontiers: list[Frontier]) -> None:
        """Choose these again, which were skipped."""
        again = {(frontier.x_m, frontier.y_m) for frontier in frontiers}
        self._skipped_m = [place for place in self._skipped_m if place not in again]

    def goal(self, frontier: Frontier) -> Goal:
        """Return the viewpoint, facing the frontier if it is away from it."""
        (x_m, y_m), tolerance_m = frontier.viewpoint_m, self._options.tolerance_m
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
