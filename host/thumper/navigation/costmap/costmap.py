"""The grid of costs that planner and controller read: the map plus what the newest scan sees. Pure."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.filters import is_closed
from thumper.navigation.costmap.inflation import (
    INSCRIBED,
    UNKNOWN,
    ByteArray,
    IntArray,
    cost_table,
    reach_cells,
    squared_distances,
)
from thumper.navigation.footprint import Footprint


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapOptions:
    """How obstacles become costs."""

    # Distance from an obstacle at which its cost ends [m]; more keeps the path further away where there is
    # room.
    inflation_radius_m: Annotated[float, Gt(0)] = 0.55
    # Decay of the cost with distance [1/m]; less spreads the cost further out.
    decay_per_m: Annotated[float, Gt(0)] = 6.0
    # Occupancy from which a map cell is an obstacle [percent].
    lethal_percent: Annotated[int, Interval(ge=1, le=100)] = 60
    # Side of the rolling window round the robot that controllers read [m].
    window_m: Annotated[float, Gt(0)] = 4.0
    # Side of its cells [m]; finer lets the robot through tighter gaps, and costs time.
    window_resolution_m: Annotated[float, Gt(0)] = 0.025
    # Map cells this near to a point that the lidar has just seen are left to the point [m].
    trust_m: Annotated[float, Gt(0)] = 0.08


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Costmap:
    """Costs, shape (rows, cols), uint8, laid out as the `OccupancyGrid` they came from.

    254 obstacle, 253 nearer than the inscribed radius, 252 ... 1 decaying, 0 free, 255 unknown.
    `squared_cells` is the squared distance to the nearest obstacle [cells^2], capped (see
    `squared_distances`).
    """

    costs: ByteArray
    squared_cells: IntArray
    resolution_m: float
    origin_x_m: float
    origin_y_m: float

    @property
    def origin_m(self) -> FloatArray:
        """Corner of cell [0, 0], shape (2,) [m]."""
        return np.array((self.origin_x_m, self.origin_y_m))

    def cells_of(self, points_m: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(rows, cols) of points, shape (n, 2); may lie outside."""
        cells = np.floor((points_m - self.origin_m) / self.resolution_m).astype(np.int64)
        return cells[:, 1], cells[:, 0]


def mark(lethal: NDArray[np.bool_], points_m: FloatArray, grid: OccupancyGrid) -> None:
    """Set the cells under points, shape (n, 2), in place; points off the grid or not finite are dropped."""
    points_m = points_m[np.isfinite(points_m).all(axis=1)]
    cells = np.floor((points_m - (grid.origin_x_m, grid.origin_y_m)) / grid.resolution_m).astype(np.int64)
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < lethal.shape[1]) & (cells[:, 1] < lethal.shape[0])
    cells = cells[inside]
    lethal[cells[:, 1], cells[:, 0]] = True


def build_costmap(
    grid: OccupancyGrid,
    hits_in_map_m: FloatArray,
    footprint: Footprint,
    options: CostmapOptions,
    keepout: OccupancyGrid | None = None,
) -> Costmap:
    """Layer keep-out mask and hits, shape (n, 2) [m], on the map and inflate the sum.

    The hits are marked afresh in every call, so that an obstacle acts in the cycle it is seen in and
    leaves no ghost of its own: forgetting is the map's business. Unknown cells stay unknown (255) unless
    they are within the inscribed radius of an obstacle. `CostmapLayers` gives the same, cycle after cycle,
    for less work.
    """
    lethal = (grid.cells >= options.lethal_percent) | is_closed(keepout, grid)
    mark(lethal, hits_in_map_m, grid)
    return _inflated(lethal, grid, footprint, options)


def inflation_reach(footprint: Footprint, options: CostmapOptions, resolution_m: float) -> int:
    """Cells up to which distances are exact.

    They also serve the footprint check, which needs the circumscribed radius and two half diagonals.
    """
    least_m = footprint.circumscribed_radius_m + 2.5 * resolution_m
    return reach_cells(max(options.inflation_radius_m, least_m), resolution_m)


def inflation_table(footprint: Footprint, options: CostmapOptions, resolution_m: float) -> ByteArray:
    """Cost of each squared distance; see `cost_table`."""
    return cost_table(
        reach=inflation_reach(footprint, options, resolution_m),
        resolution_m=resolution_m,
        inscribed_m=footprint.inscribed_radius_m,
        radius_m=options.inflation_radius_m,
        decay_per_m=options.decay_per_m,
    )


def _inflated(
    lethal: NDArray[np.bool_], grid: OccupancyGrid, footprint: Footprint, options: CostmapOptions
) -> Costmap:
    squared = squared_distances(lethal, inflation_reach(footprint, options, grid.resolution_m))
    costs = inflation_table(footprint, options, grid.resolution_m)[squared]
    costs[(grid.cells < 0) & (costs < INSCRIBED)] = UNKNOWN
    return Costmap(
        costs=costs,
        squared_cells=squared,
        resolution_m=grid.resolution_m,
        origin_x_m=grid.origin_x_m,
        origin_y_m=grid.origin_y_m,
    )


def build_window(
    grid: OccupancyGrid,
    hits_in_map_m: FloatArray,
    map_from_base: Pose2,
    footprint: Footprint,
    options: CostmapOptions,
    keepout: OccupancyGrid | None = None,
) -> Costmap:
    """The rolling window round the robot, finer than the map: where the scan has hit, its points count, not
    cells.

    A cell of the map that merely holds a hit is an obstacle as wide as a cell; beside a gap hardly wider than
    the robot that closes it. So map cells within `trust_m` of a hit are left to the hits.
    """
    fine = max(1, round(grid.resolution_m / options.window_resolution_m))
    row, col = grid.cell_of(map_from_base.x_m, map_from_base.y_m)
    half = math.ceil(0.5 * options.window_m / grid.resolution_m)
    rows, cols = grid.cells.shape
    top, bottom = min(max(0, row - half), rows - 1), min(max(1, row + half + 1), rows)
    left, right = min(max(0, col - half), cols - 1), min(max(1, col + half + 1), cols)
    window = OccupancyGrid(
        cells=grid.cells[top:bottom, left:right].repeat(fine, 0).repeat(fine, 1),
        resolution_m=grid.resolution_m / fine,
        origin_x_m=grid.origin_x_m + left * grid.resolution_m,
        origin_y_m=grid.origin_y_m + top * grid.resolution_m,
    )
    hits = np.zeros(window.cells.shape, np.bool_)
    mark(hits, hits_in_map_m, window)
    trust = reach_cells(options.trust_m, window.resolution_m)
    untold = squared_distances(hits, trust) > trust * trust
    lethal = hits | ((window.cells >= options.lethal_percent) & untold) | is_closed(keepout, window)
    return _inflated(lethal, window, footprint, options)
