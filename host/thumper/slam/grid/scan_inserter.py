"""Insert a scan into the counts: a beam hits the cell at its end and misses the cells it crosses."""

import math

import numpy as np

from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, CellArray
from thumper.slam.grid.ray_casting import Beams, LayerArray, cast_rays
from thumper.slam.scan_matching.distance_field import (
    CountArray,
    HitCells,
    add_obstacle,
    is_occupied,
    remove_obstacle,
)

TOUCHED = 1
COUNT_MAX = 250  # both counts are halved beyond this: the fraction stays, and old evidence fades


@kernel
def add_observation(hits: int, misses: int, hit: bool) -> tuple[int, int]:
    """Return the counts of a cell after one more observation."""
    if hits >= COUNT_MAX or misses >= COUNT_MAX:
        hits, misses = hits // 2, misses // 2
    if hit:
        return hits + 1, misses
    return hits, misses + 1


@kernel
def observe_cell(row: int, col: int, hit: bool, cells: HitCells) -> None:
    """Add one observation to a cell, and update the distances if its state changes."""
    hits, misses, fraction = cells.hits, cells.misses, cells.occupied_fraction
    before = is_occupied(hits[row, col], misses[row, col], fraction)
    new_hits, new_misses = add_observation(int(hits[row, col]), int(misses[row, col]), hit)
    hits[row, col], misses[row, col] = new_hits, new_misses
    after = is_occupied(hits[row, col], misses[row, col], fraction)
    if after and not before:
        add_obstacle(row, col, cells.distance_m, cells.resolution_m, cells.max_distance_cells)
    elif before and not after:
        remove_obstacle(row, col, cells)


@kernel
def insert_scan(beams: Beams, layer: LayerArray, cells: HitCells) -> None:
    """Insert one scan. Every beam must lie inside the arrays.

    Each cell counts once per scan, and a hit outweighs any number of beams that cross the same cell.
    Otherwise beams that graze a wall would wear it away. `layer`, one byte per cell, is scratch memory: zero
    before and after.
    """
    ends, kinds = beams.ends, beams.kinds
    for i in range(kinds.size):
        if kinds[i] == HIT:
            row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
            if not layer[row, col]:
                layer[row, col] = TOUCHED
                observe_cell(row, col, True, cells)
    crossed = cast_rays(beams, 0, 1, TOUCHED, layer)
    for i in range(crossed.shape[0]):
        observe_cell(crossed[i, 0], crossed[i, 1], False, cells)
        layer[crossed[i, 0], crossed[i, 1]] = 0
    for i in range(kinds.size):
        if kinds[i] == HIT:
            layer[math.floor(ends[i, 1]), math.floor(ends[i, 0])] = 0


@kernel
def occupancy(hits: CountArray, misses: CountArray, occupied_fraction: float) -> CellArray:
    """Return each cell as free, occupied or unknown, shape (rows, columns)."""
    found = np.empty(hits.shape, dtype=np.int8)
    for row in range(hits.shape[0]):
        for col in range(hits.shape[1]):
            known = hits[row, col] > 0 or misses[row, col] > 0
            occupied = is_occupied(hits[row, col], misses[row, col], occupied_fraction)
            found[row, col] = OCCUPIED if occupied else FREE if known else UNKNOWN
    return found
