"""Entering a scan into the counts: the cell at a beam's end is hit, the cells it crosses are missed."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.geometry import FloatArray
from thumper.kernel import kernel
from thumper.mapping.distance_field import (
    CountArray,
    FieldArray,
    NearestArray,
    is_occupied,
    mark,
    unmark,
)
from thumper.mapping.scan_points import HIT, SILENT, KindArray

COUNT_MAX = 60_000  # halved together beyond this, so that the fraction stays and uint16 never wraps


@kernel
def count(
    row: int,
    col: int,
    hit: bool,
    hits: CountArray,
    misses: CountArray,
    distance_m: FieldArray,
    nearest: NearestArray,
    resolution_m: float,
    reach: int,
    occupied_fraction: float,
) -> None:
    """Add one observation to a cell and carry a change of its state into the distance field."""
    before = is_occupied(hits[row, col], misses[row, col], occupied_fraction)
    if hits[row, col] >= COUNT_MAX or misses[row, col] >= COUNT_MAX:
        hits[row, col] //= 2
        misses[row, col] //= 2
    if hit:
        hits[row, col] += 1
    else:
        misses[row, col] += 1
    after = is_occupied(hits[row, col], misses[row, col], occupied_fraction)
    if after and not before:
        mark(row, col, distance_m, nearest, resolution_m, reach)
    elif before and not after:
        unmark(row, col, hits, misses, distance_m, nearest, resolution_m, reach, occupied_fraction)


@kernel
def integrate(
    origins: FloatArray,
    ends: FloatArray,
    kinds: KindArray,
    stamp: int,
    stamps: NDArray[np.int32],
    hits: CountArray,
    misses: CountArray,
    distance_m: FieldArray,
    nearest: NearestArray,
    resolution_m: float,
    reach: int,
    occupied_fraction: float,
) -> None:
    """Enter one scan. `origins` and `ends`, shape (n, 2), are in cells: integer parts are (column, row).

    Each cell counts once a scan, and a hit outweighs any number of beams that pass through the same cell:
    otherwise beams that graze a wall wear it away. `stamps` remembers the last scan that touched a cell.
    Everything must lie inside the arrays. Traversal: Amanatides and Woo, "A fast voxel traversal algorithm",
    Eurographics 1987.
    """
    for i in range(kinds.size):
        if kinds[i] == HIT:
            row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
            if stamps[row, col] != stamp:
                stamps[row, col] = stamp
                count(
                    row, col, True, hits, misses, distance_m, nearest, resolution_m, reach, occupied_fraction
                )
    for i in range(kinds.size):
        if kinds[i] == SILENT:
            continue
        row, col = math.floor(origins[i, 1]), math.floor(origins[i, 0])
        end_row, end_col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
        dx, dy = ends[i, 0] - origins[i, 0], ends[i, 1] - origins[i, 1]
        step_col, step_row = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
        # Fraction of the beam at which it crosses into the next column or row, and between two crossings.
        next_x = ((col + (dx > 0.0)) - origins[i, 0]) / dx if dx != 0.0 else math.inf
        next_y = ((row + (dy > 0.0)) - origins[i, 1]) / dy if dy != 0.0 else math.inf
        every_x = abs(1.0 / dx) if dx != 0.0 else math.inf
        every_y = abs(1.0 / dy) if dy != 0.0 else math.inf
        for _ in range(abs(end_row - row) + abs(end_col - col)):
            if stamps[row, col] != stamp:
                stamps[row, col] = stamp
                count(
                    row, col, False, hits, misses, distance_m, nearest, resolution_m, reach, occupied_fraction
                )
            if next_x < next_y:
                next_x += every_x
                col += step_col
            else:
                next_y += every_y
                row += step_row
