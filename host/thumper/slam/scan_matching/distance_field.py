"""Distance to the nearest occupied cell, updated exactly as cells become occupied and free.

The score of a beam is then one table look-up, and an update costs only where a cell has changed. The idea is
that of Lau, Sprunk, Burgard, "Improved updating of Euclidean distance maps and Voronoi diagrams", IROS 2010.
Here the distance is bounded, so a plain window replaces their wave front.

`distance_m`, float32, shape (rows, columns), is measured between cell centres and cut off at the largest
distance.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel

FieldArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]
CountArray = NDArray[np.uint8]


class DistanceField(NamedTuple):
    """A distance field to match against. Numba passes a named tuple of arrays as it is."""

    distance_m: FieldArray  # shape (rows, columns)
    resolution_m: float
    max_distance_m: float  # cut-off: cells at this distance have nothing near them


class HitCells(NamedTuple):
    """Counts and distances of one grid, arrays of shape (rows, columns). `distance_m` may be empty."""

    hits: CountArray
    misses: CountArray
    distance_m: FieldArray
    resolution_m: float
    max_distance_cells: int
    occupied_fraction: float  # share of hits that makes a cell occupied


@kernel
def is_occupied(hits: int, misses: int, occupied_fraction: float) -> bool:
    """Return whether enough of the beams that reached the cell ended in it."""
    return hits > 0 and hits >= occupied_fraction * (hits + misses)


@kernel
def cell_distance_m(rows: int, cols: int, resolution_m: float) -> np.float32:
    """Return the distance between two cells that many rows and columns apart [m]."""
    return np.float32(resolution_m * math.sqrt(rows * rows + cols * cols))


@kernel
def add_obstacle(
    row: int, col: int, distance_m: FieldArray, resolution_m: float, max_distance_cells: int
) -> None:
    """Shorten the distances around a cell that became occupied."""
    for r in range(max(0, row - max_distance_cells), min(distance_m.shape[0], row + max_distance_cells + 1)):
        for c in range(
            max(0, col - max_distance_cells), min(distance_m.shape[1], col + max_distance_cells + 1)
        ):
            candidate_m = cell_distance_m(r - row, c - col, resolution_m)
            distance_m[r, c] = min(distance_m[r, c], candidate_m)


@kernel
def remove_obstacle(row: int, col: int, cells: HitCells) -> None:
    """Recompute the distances around a cell that became free.

    The cell's counts must already be those of a free cell.
    """
    distance_m, resolution_m, reach = cells.distance_m, cells.resolution_m, cells.max_distance_cells
    rows, cols = distance_m.shape
    max_distance_m = np.float32(reach * resolution_m)
    top, bottom, left, right = rows, -1, cols, -1
    for r in range(max(0, row - reach), min(rows, row + reach + 1)):
        for c in range(max(0, col - reach), min(cols, col + reach + 1)):
            own_m = cell_distance_m(r - row, c - col, resolution_m)
            if distance_m[r, c] < max_distance_m and distance_m[r, c] == own_m:
                distance_m[r, c] = max_distance_m
                top, bottom = min(top, r), max(bottom, r)
                left, right = min(left, c), max(right, c)
    for r in range(max(0, top - reach), min(rows, bottom + reach + 1)):
        for c in range(max(0, left - reach), min(cols, right + reach + 1)):
            if is_occupied(cells.hits[r, c], cells.misses[r, c], cells.occupied_fraction):
                add_obstacle(r, c, distance_m, resolution_m, reach)
