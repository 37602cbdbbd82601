"""Kernels on a grid of solid cells: ray casting, and the clearance of a polygon.

Rays step from cell to cell (Amanatides and Woo, 1987) and jump over free space. Cell [row, column] of a grid
of shape (rows, columns) starts at x = x_lo_m + column * resolution_m and y = y_lo_m + row * resolution_m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper_hil.world.segment_raycast import BoolArray, GridGeometry, polygon_clearance_m

StepArray = NDArray[np.int32]

MIN_JUMP_CELLS = 6  # a shorter jump costs more than the steps it saves


@kernel
def cast_grid(
    origins_m: FloatArray,
    angles_rad: FloatArray,
    distance: StepArray,
    geometry: GridGeometry,
    out: FloatArray,
) -> None:
    """Lower `out`, shape (n,), to the distance at which each ray enters a solid cell; 0 inside one.

    `origins_m` has shape (n, 2), `angles_rad` (n,). A ray that starts outside the grid enters at its border.
    `distance`, shape (rows, columns), is each cell's chessboard distance to the nearest solid cell. A ray can
    jump that far without a check.
    """
    rows, columns = distance.shape
    resolution_m, x_lo_m, y_lo_m = geometry
    for i in range(angles_rad.size):
        dx, dy = math.cos(angles_rad[i]), math.sin(angles_rad[i])
        x = (origins_m[i, 0] - x_lo_m) / resolution_m
        y = (origins_m[i, 1] - y_lo_m) / resolution_m
        start = _entry(x, y, dx, dy, columns, rows)
        if start == math.inf:
            continue
        # Start slightly inside, so that rounding at the border does not skip the first cell.
        inside = start + 1e-9 if start > 0.0 else 0.0
        column, row = math.floor(x + inside * dx), math.floor(y + inside * dy)
        step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
        each_x = 1.0 / abs(dx) if dx != 0.0 else math.inf
        each_y = 1.0 / abs(dy) if dy != 0.0 else math.inf
        next_x = (column + (1 if step_x > 0 else 0) - x) / dx if dx != 0.0 else math.inf
        next_y = (row + (1 if step_y > 0 else 0) - y) / dy if dy != 0.0 else math.inf
        t, nearest = start, out[i] / resolution_m
        while t < nearest and 0 <= column < columns and 0 <= row < rows:
            free = distance[row, column]
            if free == 0:
                out[i] = t * resolution_m
                break
            if free > MIN_JUMP_CELLS:
                t += free - 1.0
                column, row = math.floor(x + t * dx), math.floor(y + t * dy)
                next_x = (column + (1 if step_x > 0 else 0) - x) / dx if dx != 0.0 else math.inf
                next_y = (row + (1 if step_y > 0 else 0) - y) / dy if dy != 0.0 else math.inf
                continue
            if next_x < next_y:
                t = next_x
                next_x += each_x
                column += step_x
            else:
                t = next_y
                next_y += each_y
                row += step_y


@kernel
def _entry(x: float, y: float, dx: float, dy: float, width: float, height: float) -> float:
    """Return where the ray enters [0, width] x [0, height]: 0 if it starts inside, +inf if it misses."""
    enter, leave = 0.0, math.inf
    for start, direction, size in ((x, dx, width), (y, dy, height)):
        if direction == 0.0:
            if start < 0.0 or start > size:
                return math.inf
            continue
        a, b = -start / direction, (size - start) / direction
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter if enter < leave else math.inf


@kernel
def grid_clearance_m(
    polygon_m: FloatArray,
    solid: BoolArray,
    geometry: GridGeometry,
    farthest_m: float,
) -> float:
    """Return the distance from a filled polygon, shape (k, 2), to a solid cell, at most `farthest_m`."""
    rows, columns = solid.shape
    resolution_m, x_lo_m, y_lo_m = geometry
    first_column = max(math.floor((polygon_m[:, 0].min() - farthest_m - x_lo_m) / resolution_m), 0)
    last_column = min(math.floor((polygon_m[:, 0].max() + farthest_m - x_lo_m) / resolution_m), columns - 1)
    first_row = max(math.floor((polygon_m[:, 1].min() - farthest_m - y_lo_m) / resolution_m), 0)
    last_row = min(math.floor((polygon_m[:, 1].max() + farthest_m - y_lo_m) / resolution_m), rows - 1)
    square, none = np.empty((4, 4)), np.empty((0, 3))
    nearest = farthest_m
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            if not solid[row, column]:
                continue
            x0, y0 = x_lo_m + column * resolution_m, y_lo_m + row * resolution_m
            x1, y1 = x0 + resolution_m, y0 + resolution_m
            square[0] = (x0, y0, x1, y0)
            square[1] = (x1, y0, x1, y1)
            square[2] = (x1, y1, x0, y1)
            square[3] = (x0, y1, x0, y0)
            nearest = min(nearest, polygon_clearance_m(polygon_m, square, none))
            if nearest <= 0.0:
                return 0.0
    return nearest
