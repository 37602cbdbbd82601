"""Edit a finished map: fill boxes, crop, trim, rotate. Unknown cells stay unknown."""

import math
from dataclasses import dataclass, replace

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.maps.occupancy_grid import OCCUPIED, UNKNOWN, OccupancyGrid

TOLERANCE_CELLS = 1e-6  # rounding error of a coordinate that lies on a cell border


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangle along the map's axes [m], from any two opposite corners."""

    x0_m: float
    y0_m: float
    x1_m: float
    y1_m: float


def fill_box(grid: OccupancyGrid, box: Box, state: int) -> OccupancyGrid:
    """Return the map with all cells that the box touches set to `state`; a line is one cell wide.

    Raises
    ------
    ThumperError
        The box lies outside the map.
    """
    cells = grid.cells.copy()
    rows, cols = _cells_in(grid, box)
    cells[rows, cols] = state
    return replace(grid, cells=cells)


def crop(grid: OccupancyGrid, box: Box) -> OccupancyGrid:
    """Return the part of the map that the box touches; each cell keeps its position.

    Raises
    ------
    ThumperError
        The box lies outside the map.
    """
    return _slice(grid, *_cells_in(grid, box))


def trim(grid: OccupancyGrid, margin_m: float = 0.5) -> OccupancyGrid:
    """Return the known part of a map and a margin around it; an unknown map stays as it is."""
    known = np.argwhere(grid.cells != UNKNOWN)
    if not known.size:
        return grid
    margin = math.ceil(margin_m / grid.resolution_m - TOLERANCE_CELLS)
    low = np.maximum(known.min(axis=0) - margin, 0)
    high = np.minimum(known.max(axis=0) + margin + 1, grid.cells.shape)
    return _slice(grid, slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1])))


def rotate(grid: OccupancyGrid, angle_rad: float) -> OccupancyGrid:
    """Return the map rotated counter-clockwise about the origin of its frame.

    Each new cell takes the state of the nearest old one. An occupied cell that is nearest to no new cell is
    kept, too, so that a chair leg does not vanish.
    """
    rows, cols = grid.cells.shape
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    corners = np.array([(0, 0), (cols, 0), (cols, rows), (0, rows)]) * grid.resolution_m
    corners += (grid.origin_x_m, grid.origin_y_m)
    turned = corners @ np.array([[cos, sin], [-sin, cos]])
    low, high = turned.min(axis=0), turned.max(axis=0)
    new_cols, new_rows = (int(size) for size in np.ceil(np.round((high - low) / grid.resolution_m, 6)))
    x = low[0] + (np.arange(new_cols) + 0.5) * grid.resolution_m
    y = low[1] + (np.arange(new_rows) + 0.5)[:, np.newaxis] * grid.resolution_m
    col = np.floor((cos * x + sin * y - grid.origin_x_m) / grid.resolution_m + 1e-9).astype(np.int64)
    row = np.floor((-sin * x + cos * y - grid.origin_y_m) / grid.resolution_m + 1e-9).astype(np.int64)
    inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    cells = np.full((new_rows, new_cols), UNKNOWN, dtype=np.int8)
    cells[inside] = grid.cells[row[inside], col[inside]]
    centres = np.argwhere(grid.cells == OCCUPIED)[:, ::-1] + 0.5
    centres = centres * grid.resolution_m + (grid.origin_x_m, grid.origin_y_m)
    kept = np.floor((centres @ np.array([[cos, sin], [-sin, cos]]) - low) / grid.resolution_m).astype(
        np.int64
    )
    cells[kept[:, 1], kept[:, 0]] = OCCUPIED
    return replace(grid, cells=cells, origin_x_m=float(low[0]), origin_y_m=float(low[1]))


def _cells_in(grid: OccupancyGrid, box: Box) -> tuple[slice, slice]:
    """Return the rows and columns that overlap the box; a line or point overlaps the cells it lies in."""
    ranges = []
    for name, ends, origin_m, size in (
        ("y", (box.y0_m, box.y1_m), grid.origin_y_m, grid.cells.shape[0]),
        ("x", (box.x0_m, box.x1_m), grid.origin_x_m, grid.cells.shape[1]),
    ):
        first = math.floor((min(ends) - origin_m) / grid.resolution_m + TOLERANCE_CELLS)
        last = max(first, math.ceil((max(ends) - origin_m) / grid.resolution_m - TOLERANCE_CELLS) - 1)
        if last < 0 or first >= size:
            end_m = origin_m + size * grid.resolution_m
            raise ThumperError(
                f"the box from {name} = {min(ends):g} to {max(ends):g} lies outside the map, "
                f"which extends from {origin_m:g} to {end_m:g}",
                exit_code=EXIT_USAGE,
            )
        ranges.append(slice(max(0, first), min(size, last + 1)))
    return ranges[0], ranges[1]


def _slice(grid: OccupancyGrid, rows: slice, cols: slice) -> OccupancyGrid:
    return replace(
        grid,
        cells=grid.cells[rows, cols].copy(),
        origin_x_m=grid.origin_x_m + cols.start * grid.resolution_m,
        origin_y_m=grid.origin_y_m + rows.start * grid.resolution_m,
    )
