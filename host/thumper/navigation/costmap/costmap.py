"""The costmap that planners and controllers read: the map plus the newest scan, inflated. Pure."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.distance_transform import squared_distances
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.filters import Masks, keepout_cells
from thumper.navigation.costmap.inflation import (
    INSCRIBED,
    UNKNOWN,
    ByteArray,
    IntArray,
    cost_table,
    whole_cells,
)
from thumper.navigation.footprint import Footprint

SCAN_OVERRIDE_M = 0.08  # in the window, the scan's hits replace map cells this near to them


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapOptions:
    """How obstacles turn into costs."""

    # Distance from an obstacle at which its cost ends [m]; more keeps paths further away where there is room.
    inflation_radius_m: Annotated[float, Gt(0)] = 0.55
    # Decay of the cost with distance [1/m]; less spreads the cost further.
    decay_per_m: Annotated[float, Gt(0)] = 6.0
    # Occupancy at and above which a map cell is an obstacle [percent].
    lethal_percent: Annotated[int, Interval(ge=1, le=100)] = 60
    # Side of the rolling window round the robot that the controllers read [m].
    window_m: Annotated[float, Gt(0)] = 4.0
    # Cell size of this window [m]; finer cells let the robot through narrower gaps and cost time.
    window_resolution_m: Annotated[float, Gt(0)] = 0.025


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Costmap:
    """Costs, shape (rows, cols), uint8, in the layout of their `OccupancyGrid`.

    254 obstacle, 253 within the inscribed radius, 252 ... 1 decaying, 0 free, 255 unknown.
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
        """Return (rows, cols) of points, shape (n, 2) [m]; they may be outside the costmap."""
        cells = np.floor((points_m - self.origin_m) / self.resolution_m).astype(np.int64)
        return cells[:, 1], cells[:, 0]


def mark_points(lethal: NDArray[np.bool_], points_m: FloatArray, grid: OccupancyGrid) -> None:
    """Set the cells under points, shape (n, 2), in place; ignore points off the grid or not finite."""
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
    keepout: Masks = (),
) -> Costmap:
    """Combine map, keep-out masks and hits, shape (n, 2) [m], and inflate them.

    Each call marks only the hits that it is given, so an obstacle acts in the cycle that sees it and leaves
    nothing behind: clearing is the map's job. Unknown cells stay unknown (255) unless they are within the
    inscribed radius of an obstacle. `CostmapLayers` computes the same incrementally.
    """
    lethal = (grid.cells >= options.lethal_percent) | keepout_cells(keepout, grid)
    mark_points(lethal, hits_in_map_m, grid)
    return _inflated(lethal, grid, footprint, options)


def inflation_radius_cells(footprint: Footprint, options: CostmapOptions, resolution_m: float) -> int:
    """Return the radius up to which distances are exact [cells].

    The footprint check needs them too, up to the circumscribed radius and two half diagonals.
    """
    least_m = footprint.circumscribed_radius_m + 2.5 * resolution_m
    return whole_cells(max(options.inflation_radius_m, least_m), resolution_m)


def inflation_table(footprint: Footprint, options: CostmapOptions, resolution_m: float) -> ByteArray:
    """Return the cost of each squared distance; see `cost_table`."""
    return cost_table(
        radius_cells=inflation_radius_cells(footprint, options, resolution_m),
        resolution_m=resolution_m,
        inscribed_m=footprint.inscribed_radius_m,
        radius_m=options.inflation_radius_m,
        decay_per_m=options.decay_per_m,
    )


def _inflated(
    lethal: NDArray[np.bool_], grid: OccupancyGrid, footprint: Footprint, options: CostmapOptions
) -> Costmap:
    squared = squared_distances(lethal, inflation_radius_cells(footprint, options, grid.resolution_m))
    costs = inflation_table(footprint, options, grid.resolution_m)[squared]
    costs[(grid.cells < 0) & (costs < INSCRIBED)] = UNKNOWN
    return Costmap(
        costs=costs,
        squared_cells=squared,
        resolution_m=grid.resolution_m,
        origin_x_m=grid.origin_x_m,
        origin_y_m=grid.origin_y_m,
    )


def square_around(costmap: Costmap, x_m: float, y_m: float, radius_m: float) -> tuple[slice, slice]:
    """Return the rows and columns of the square round a place, as far as they are in the costmap."""
    (row,), (col,) = costmap.cells_of(np.array(((x_m, y_m),)))
    half = math.ceil(radius_m / costmap.resolution_m) + 1
    rows, cols = (slice(max(0, int(k) - half), max(0, int(k) + half + 1)) for k in (row, col))
    return rows, cols


def part_of(costmap: Costmap, rows: slice, cols: slice) -> Costmap:
    """Return a view of a part of a costmap."""
    return replace(
        costmap,
        costs=costmap.costs[rows, cols],
        squared_cells=costmap.squared_cells[rows, cols],
        origin_x_m=costmap.origin_x_m + cols.start * costmap.resolution_m,
        origin_y_m=costmap.origin_y_m + rows.start * costmap.resolution_m,
    )


def window_of(grid: OccupancyGrid, map_from_base: Pose2, options: CostmapOptions) -> OccupancyGrid:
    """Return a copy of the map round the robot, in cells finer than the map's."""
    fine = max(1, round(grid.resolution_m / options.window_resolution_m))
    row, col = grid.cell_of(map_from_base.x_m, map_from_base.y_m)
    half = math.ceil(0.5 * options.window_m / grid.resolution_m)
    rows, cols = grid.cells.shape
    top, bottom = min(max(0, row - half), rows - 1), min(max(1, row + half + 1), rows)
    left, right = min(max(0, col - half), cols - 1), min(max(1, col + half + 1), cols)
    return OccupancyGrid(
        cells=grid.cells[top:bottom, left:right].repeat(fine, 0).repeat(fine, 1),
        resolution_m=grid.resolution_m / fine,
        origin_x_m=grid.origin_x_m + left * grid.resolution_m,
        origin_y_m=grid.origin_y_m + top * grid.resolution_m,
    )


def build_window(
    window: OccupancyGrid,
    hits_in_map_m: FloatArray,
    unseen_m: FloatArray,
    footprint: Footprint,
    options: CostmapOptions,
    keepout: Masks = (),
) -> Costmap:
    """Return the costs of the rolling window round the robot; `unseen_m`, shape (n, 2), is closed as well.

    A map cell that holds one hit is an obstacle as wide as the cell, which closes a gap hardly wider than the
    robot. So the exact hits replace all map cells within `SCAN_OVERRIDE_M` of them.
    """
    hits = np.zeros(window.cells.shape, np.bool_)
    mark_points(hits, hits_in_map_m, window)
    override = whole_cells(SCAN_OVERRIDE_M, window.resolution_m)
    unscanned = squared_distances(hits, override) > override * override
    lethal = hits | ((window.cells >= options.lethal_percent) & unscanned) | keepout_cells(keepout, window)
    mark_points(lethal, unseen_m, window)
    return _inflated(lethal, window, footprint, options)
