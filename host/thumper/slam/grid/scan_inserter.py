"""Insert a scan into the counts: a beam hits the cell at its end and misses the cells it crosses."""

import math

import numpy as np

from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT
from thumper.slam.grid.patch_distances import add_obstacle, remove_obstacle
from thumper.slam.grid.ray_casting import CrossedArray, GridBeams, LayerArray, cast_rays
from thumper.slam.scan_matching.distance_field import CountArray, InsertionRule, is_occupied
from thumper.slam.scan_matching.patch_grid import PatchGrid, make_patches
from thumper.slam.scan_matching.patches import MASK, SIDE_BITS

TOUCHED = 1
COUNT_MAX = 250  # both counts are halved beyond this: the fraction stays, and old evidence fades


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
def _observe_cell(row: int, col: int, hit: bool, cells: PatchGrid, rule: InsertionRule) -> None:
    """Add one observation to a cell of the table, and update the distances if its state changes."""
    table, pool = cells.table, cells.pool
    patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
    hits, misses = int(pool.hits[patch, r, c]), int(pool.misses[patch, r, c])
    before = is_occupied(hits, misses, rule.occupied_fraction)
    pool.hits[patch, r, c], pool.misses[patch, r, c], after = observe(hits, misses, hit, before, rule)
    if pool.distance.shape[1] == 0:
        return
    if after and not before:
        add_obstacle(row, col, table, pool, rule)
    elif before and not after:
        remove_obstacle(row, col, table, pool, rule)


@kernel
def insert_scan(
    beams: GridBeams, layer: LayerArray, first: tuple[int, int], cells: PatchGrid, rule: InsertionRule
) -> bool:
    """Insert one scan; return false, without an effect, if the pool has too few patches: let it grow first.

    Each cell counts once per scan, and a hit outweighs any number of beams that cross the same cell.
    Otherwise beams that graze a wall would mark its cells free. `layer`, one byte per cell from the cell
    `first` on, is scratch memory: zero before and after. With `rule.release` = 1 the counts alone decide what
    is occupied.
    """
    table, pool = cells.table, cells.pool
    ended = _ends(beams, layer, first)
    crossed = cast_rays(beams, 0, 1, TOUCHED, layer, first)
    complete = make_patches(ended, rule.max_distance_cells if pool.distance.shape[1] else 0, cells)
    for i in range(ended.shape[0]):
        layer[ended[i, 0] - first[0], ended[i, 1] - first[1]] = 0
    for i in range(crossed.shape[0]):
        row, col = crossed[i, 0], crossed[i, 1]
        layer[row - first[0], col - first[1]] = 0
        if table[(row + cells.row) >> SIDE_BITS, (col + cells.col) >> SIDE_BITS] == 0:
            complete = make_patches(crossed[i : i + 1], 0, cells) and complete
    if complete:
        _count(ended, crossed, cells, rule)
    return complete


@kernel
def _ends(beams: GridBeams, layer: LayerArray, first: tuple[int, int]) -> CrossedArray:
    """Return the cells, (row, column), in which hits end, and mark them."""
    ends, kinds = beams.ends, beams.kinds
    ended, n = np.empty((kinds.size, 2), dtype=np.int32), 0
    for i in range(kinds.size):
        if kinds[i] == HIT:
            row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
            if not layer[row - first[0], col - first[1]]:
                layer[row - first[0], col - first[1]] = TOUCHED
                ended[n, 0], ended[n, 1] = row, col
                n += 1
    return ended[:n]


@kernel
def _count(ended: CrossedArray, crossed: CrossedArray, cells: PatchGrid, rule: InsertionRule) -> None:
    """Count a hit in each cell where a beam ended, and a miss in those that beams crossed."""
    table, hits, misses = cells.table, cells.pool.hits, cells.pool.misses
    for i in range(ended.shape[0]):
        _observe_cell(ended[i, 0] + cells.row, ended[i, 1] + cells.col, True, cells, rule)
    for i in range(crossed.shape[0]):
        row, col = crossed[i, 0] + cells.row, crossed[i, 1] + cells.col
        patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
        if hits[patch, r, c] == 0 and misses[patch, r, c] < COUNT_MAX:
            misses[patch, r, c] += 1  # stays free: no call, which costs more than the count
        else:
            _observe_cell(row, col, False, cells, rule)


@kernel
def resume_counts(
    hits: CountArray, misses: CountArray, first: tuple[int, int], cells: PatchGrid, rule: InsertionRule
) -> None:
    """Set the counts, shape (rows, columns), from the cell `first` on. All cells with one have patches."""
    table, pool = cells.table, cells.pool
    for i in range(hits.shape[0]):
        for j in range(hits.shape[1]):
            if hits[i, j] == 0 and misses[i, j] == 0:
                continue
            row, col = first[0] + i + cells.row, first[1] + j + cells.col
            patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
            pool.hits[patch, r, c], pool.misses[patch, r, c] = hits[i, j], misses[i, j]
            if is_occupied(int(hits[i, j]), int(misses[i, j]), rule.occupied_fraction):
                add_obstacle(row, col, table, pool, rule)
