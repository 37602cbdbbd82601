"""Entering a scan into the counts: the cell at a beam's end is hit, the cells it crosses are missed."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT, KindArray
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, CellArray
from thumper.slam.grid.ray_casting import LayerArray, trace
from thumper.slam.scan_matching.distance_field import (
    CountArray,
    FieldArray,
    is_occupied,
    mark,
    unmark,
)

TOUCHED = 1
COUNT_MAX = 250  # both counts are halved beyond this: the fraction stays, and old evidence fades


@kernel
def count(
    row: int,
    col: int,
    hit: bool,
    hits: CountArray,
    misses: CountArray,
    distance_m: FieldArray,
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
        mark(row, col, distance_m, resolution_m, reach)
    elif before and not after:
        unmark(row, col, hits, misses, distance_m, resolution_m, reach, occupied_fraction)


@kernel
def integrate(
    origins: FloatArray,
    ends: FloatArray,
    kinds: KindArray,
    layer: LayerArray,
    hits: CountArray,
    misses: CountArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach: int,
    occupied_fraction: float,
) -> None:
    """Enter one scan. `origins` and `ends`, shape (n, 2), are in cells: integer parts are (column, row).

    Each cell counts once a scan, and a hit outweighs any number of beams that pass through the same cell:
    otherwise beams that graze a wall wear it away. `layer` tells them apart, a byte a cell, empty before and
    after. Everything must lie inside the arrays; an empty `distance_m` stays empty.
    """
    for i in range(kinds.size):
        if kinds[i] == HIT:
            row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
            if not layer[row, col]:
                layer[row, col] = TOUCHED
                count(row, col, True, hits, misses, distance_m, resolution_m, reach, occupied_fraction)
    crossed = trace(origins, ends, kinds, 0, 1, TOUCHED, layer)
    for i in range(crossed.shape[0]):
        count(
            crossed[i, 0],
            crossed[i, 1],
            False,
            hits,
            misses,
            distance_m,
            resolution_m,
            reach,
            occupied_fraction,
        )
        layer[crossed[i, 0], crossed[i, 1]] = 0
    for i in range(kinds.size):
        if kinds[i] == HIT:
            layer[math.floor(ends[i, 1]), math.floor(ends[i, 0])] = 0


@kernel
def states(hits: CountArray, misses: CountArray, occupied_fraction: float) -> CellArray:
    """Each cell free, occupied or unknown, shape (rows, columns)."""
    found = np.empty(hits.shape, dtype=np.int8)
    for row in range(hits.shape[0]):
        for col in range(hits.shape[1]):
            known = hits[row, col] > 0 or misses[row, col] > 0
            occupied = is_occupied(hits[row, col], misses[row, col], occupied_fraction)
            found[row, col] = OCCUPIED if occupied else FREE if known else UNKNOWN
    return found
