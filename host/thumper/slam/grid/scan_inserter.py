"""Insert a scan into the counts: a beam hits the cell at its end and misses the cells it crosses."""

import math
from typing import NamedTuple

from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT
from thumper.slam.grid.ray_casting import GridBeams, LayerArray, cast_rays
from thumper.slam.scan_matching.distance_field import (
    CountArray,
    FieldArray,
    InsertionRule,
    add_obstacle,
    is_occupied,
    remove_obstacle,
)

TOUCHED = 1
COUNT_MAX = 250  # both counts are halved beyond this: the fraction stays, and old evidence fades


class HitCells(NamedTuple):
    """Counts and distances of one grid, arrays of shape (rows, columns). `distance_m` may be empty."""

    hits: CountArray
    misses: CountArray
    distance_m: FieldArray


@kernel
def observe(hits: int, misses: int, hit: bool, occupied: bool, rule: InsertionRule) -> tuple[int, int, bool]:
    """Return the counts of a cell after one more observation, and whether it is occupied from now on.

    `occupied` is whether it was before: then less than the full share of hits keeps it.
    """
    if hits >= COUNT_MAX or misses >= COUNT_MAX:
        hits, misses = hits // 2, misses // 2
    hits, misses = (hits + 1, misses) if hit else (hits, misses + 1)
    return (
        hits,
        misses,
        is_occupied(hits, misses, (rule.release if occupied else 1.0) * rule.occupied_fraction),
    )


@kernel
def _observe_cell(row: int, col: int, hit: bool, cells: HitCells, rule: InsertionRule) -> None:
    """Add one observation to a cell, and update the distances if its state changes."""
    hits, misses = cells.hits, cells.misses
    before = is_occupied(hits[row, col], misses[row, col], rule.occupied_fraction)
    hits[row, col], misses[row, col], after = observe(
        int(hits[row, col]), int(misses[row, col]), hit, before, rule
    )
    if after and not before:
        add_obstacle(row, col, cells.distance_m, rule)
    elif before and not after:
        remove_obstacle(row, col, cells.distance_m, rule)


@kernel
def insert_scan(beams: GridBeams, layer: LayerArray, cells: HitCells, rule: InsertionRule) -> None:
    """Insert one scan. Every beam must lie inside the arrays.

    Each cell counts once per scan, and a hit outweighs any number of beams that cross the same cell.
    Otherwise beams that graze a wall would mark its cells free. `layer`, one byte per cell, is scratch
    memory: zero before and after. With `rule.release` = 1 the counts alone decide what is occupied.
    """
    ends, kinds = beams.ends, beams.kinds
    hits, misses = cells.hits, cells.misses
    for i in range(kinds.size):
        if kinds[i] == HIT:
            row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
            if not layer[row, col]:
                layer[row, col] = TOUCHED
                _observe_cell(row, col, True, cells, rule)
    crossed = cast_rays(beams, 0, 1, TOUCHED, layer)
    for i in range(crossed.shape[0]):
        row, col = crossed[i, 0], crossed[i, 1]
        layer[row, col] = 0
        if hits[row, col] == 0 and misses[row, col] < COUNT_MAX:
            misses[row, col] += 1  # stays free: no call, which costs more than the count
        else:
            _observe_cell(row, col, False, cells, rule)
    for i in range(kinds.size):
        if kinds[i] == HIT:
            layer[math.floor(ends[i, 1]), math.floor(ends[i, 0])] = 0
