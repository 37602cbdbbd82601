"""Distance to the nearest occupied cell, kept exact while cells turn occupied and free again.

A precomputed field makes the score of a beam one table look-up, and updating it only where a cell changes
makes it cheap (the idea of Lau, Sprunk, Burgard, "Improved updating of Euclidean distance maps and Voronoi
diagrams", IROS 2010; here with a bounded reach, so a plain window replaces their wave front).

`distance_m`, float32, shape (rows, columns), is between cell centres and cut off at the reach.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel

FieldArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]
CountArray = NDArray[np.uint8]


@kernel
def is_occupied(hits: int, misses: int, occupied_fraction: float) -> bool:
    """Whether enough of the beams that reached the cell ended in it."""
    return hits > 0 and hits >= occupied_fraction * (hits + misses)


@kernel
def between_m(rows: int, cols: int, resolution_m: float) -> np.float32:
    """Distance of two cells so many rows and columns apart."""
    return np.float32(resolution_m * math.sqrt(rows * rows + cols * cols))


@kernel
def mark(row: int, col: int, distance_m: FieldArray, resolution_m: float, reach: int) -> None:
    """The cell has turned occupied: shorten the distances within `reach` cells of it."""
    for r in range(max(0, row - reach), min(distance_m.shape[0], row + reach + 1)):
        for c in range(max(0, col - reach), min(distance_m.shape[1], col + reach + 1)):
            candidate_m = between_m(r - row, c - col, resolution_m)
            distance_m[r, c] = min(distance_m[r, c], candidate_m)


@kernel
def unmark(
    row: int,
    col: int,
    hits: CountArray,
    misses: CountArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach: int,
    occupied_fraction: float,
) -> None:
    """The cell has turned free: forget the distances that may be to it and find the next nearest cells.

    `hits` and `misses` must already say that the cell is free.
    """
    rows, cols = distance_m.shape
    reach_m = np.float32(reach * resolution_m)
    top, bottom, left, right = rows, -1, cols, -1
    for r in range(max(0, row - reach), min(rows, row + reach + 1)):
        for c in range(max(0, col - reach), min(cols, col + reach + 1)):
            if distance_m[r, c] < reach_m and distance_m[r, c] == between_m(r - row, c - col, resolution_m):
                distance_m[r, c] = reach_m
                top, bottom = min(top, r), max(bottom, r)
                left, right = min(left, c), max(right, c)
    for r in range(max(0, top - reach), min(rows, bottom + reach + 1)):
        for c in range(max(0, left - reach), min(cols, right + reach + 1)):
            if is_occupied(hits[r, c], misses[r, c], occupied_fraction):
                mark(r, c, distance_m, resolution_m, reach)
