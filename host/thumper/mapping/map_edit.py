"""Cropping and turning a finished map."""

import math

import numpy as np

from thumper.mapping.grid import UNKNOWN, OccupancyGrid


def cropped(grid: OccupancyGrid, margin_m: float = 0.5) -> OccupancyGrid:
    """The known part of a map and a margin round it; a map that knows nothing stays as it is."""
    known = np.argwhere(grid.cells != UNKNOWN)
    if not known.size:
        return grid
    margin = math.ceil(margin_m / grid.resolution_m)
    low = np.maximum(known.min(axis=0) - margin, 0)
    high = np.minimum(known.max(axis=0) + margin + 1, grid.cells.shape)
    return OccupancyGrid(
        cells=grid.cells[low[0] : high[0], low[1] : high[1]].copy(),
        resolution_m=grid.resolution_m,
        origin_x_m=grid.origin_x_m + float(low[1]) * grid.resolution_m,
        origin_y_m=grid.origin_y_m + float(low[0]) * grid.resolution_m,
    )


def rotated(grid: OccupancyGrid, angle_rad: float) -> OccupancyGrid:
    """The map turned counter-clockwise about its frame's origin; each new cell takes the nearest old one."""
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
    return OccupancyGrid(
        cells=cells, resolution_m=grid.resolution_m, origin_x_m=float(low[0]), origin_y_m=float(low[1])
    )
