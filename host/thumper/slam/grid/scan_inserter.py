"""Insert a scan into the counts: a beam hits the cell at its end and misses the cells it crosses."""

import math

import numpy as np

from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT
from thumper.slam.grid.patch_distances import add_obstacle, remove_obstacle
from thumper.slam.grid.patch_free_space import (
    CROSSED,
    ENDED,
    WordArray,
    clear,
    count_misses,
    free_space_mask,
    hit_and_crossed,
)
from thumper.slam.grid.ray_casting import CrossedArray, GridBeams, LayerArray, cast_rays
from thumper.slam.scan_matching.distance_field import CountArray, InsertionRule, is_occupied
from thumper.slam.scan_matching.patch_grid import PatchGrid, make_patches
from thumper.slam.scan_matching.patches import COUNT_MAX, MASK, SIDE, SIDE_BITS, IndexArray, writable

AROUND = (2 * -(-127 // SIDE) + 1) ** 2  # patches within the largest distance of one, and itself


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
    if rule.max_distance_cells == 0:
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
    Otherwise beams that graze a wall would mark its cells free. `layer`, one byte per cell of the patches
    from `first` on, is scratch memory: zero before and after. With `rule.release` = 1 the counts alone decide
    what is occupied; with `rule.max_distance_cells` = 0 the distances stay as they are.
    """
    pool, corner = cells.pool, (first[0] * SIDE, first[1] * SIDE)
    in_map = corner[0] - cells.row, corner[1] - cells.col
    free_space = free_space_mask(cast_rays(beams, 0, 1, CROSSED, layer, in_map), layer)
    ended = _ends(beams, layer, in_map)
    in_table = PatchGrid(cells.table, pool, corner[0], corner[1])
    complete = make_patches(ended, rule.max_distance_cells, in_table)
    complete = complete and _make_crossed(free_space.patches, first, cells)
    if complete:
        for i in range(ended.shape[0]):
            _observe_cell(ended[i, 0] + corner[0], ended[i, 1] + corner[1], True, cells, rule)
        for i in range(free_space.patches.shape[0]):
            place, words = free_space.patches[i], free_space.words[i]
            patch = cells.table[place[0] + first[0], place[1] + first[1]]
            hits, misses = pool.hits[patch], pool.misses[patch]
            hit_words = hits.reshape(SIDE * SIDE).view(np.uint64)
            if count_misses(words, hit_words, misses.reshape(SIDE * SIDE).view(np.uint64)):
                _miss_hit_cells(place, words, layer, first, cells, rule)
    clear(free_space.patches, layer)
    for i in range(ended.shape[0]):
        layer[ended[i, 0], ended[i, 1]] = 0
    return complete


@kernel
def _ends(beams: GridBeams, layer: LayerArray, first: tuple[int, int]) -> CrossedArray:
    """Return the cells, (row, column) in the layer, in which hits end, and mark them."""
    ends, kinds = beams.ends, beams.kinds
    ended, n = np.empty((kinds.size, 2), dtype=np.int32), 0
    for i in range(kinds.size):
        if kinds[i] == HIT:
            row, col = math.floor(ends[i, 1]) - first[0], math.floor(ends[i, 0]) - first[1]
            if not layer[row, col] & ENDED:
                layer[row, col] |= ENDED
                ended[n, 0], ended[n, 1] = row, col
                n += 1
    return ended[:n]


@kernel
def _make_crossed(places: IndexArray, first: tuple[int, int], cells: PatchGrid) -> bool:
    """Make the patches at these places, shape (n, 2), from `first` on; return false if the pool is empty."""
    table, pool = cells.table, cells.pool
    for i in range(places.shape[0]):
        row, col = places[i, 0] + first[0], places[i, 1] + first[1]
        if table[row, col] == 0:
            if pool.free_count[0] == 0:
                return False
            writable(table, row, col, pool)
    return True


@kernel
def _miss_hit_cells(
    place: IndexArray,
    crossed: WordArray,
    layer: LayerArray,
    first: tuple[int, int],
    cells: PatchGrid,
    rule: InsertionRule,
) -> None:
    """Count a miss in the cells of one patch that were hit in earlier scans: their state may change.

    Only cells that a beam crossed and in which none ended count.
    """
    table, pool = cells.table, cells.pool
    patch = table[place[0] + first[0], place[1] + first[1]]
    hits, misses = pool.hits[patch], pool.misses[patch]
    hit_words = hits.reshape(SIDE * SIDE).view(np.uint64)
    for i in range(crossed.size):
        if not hit_and_crossed(crossed[i], hit_words[i]):
            continue
        r = 8 * i >> SIDE_BITS
        for c in range(8 * i & MASK, (8 * i & MASK) + 8):
            row, col = place[0] * SIDE + r, place[1] * SIDE + c
            if layer[row, col] != CROSSED or hits[r, c] == 0:
                continue
            hit, missed, part = int(hits[r, c]), int(misses[r, c]) + 1, rule.occupied_fraction
            # Count here what changes no cell's state: a call costs more, for its reference counting.
            if max(hit, missed) < COUNT_MAX and (
                is_occupied(hit, missed, rule.release * part) == is_occupied(hit, missed - 1, part)
            ):
                misses[r, c] = missed
            else:
                _observe_cell(row + first[0] * SIDE, col + first[1] * SIDE, False, cells, rule)


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


@kernel
def add_distances(first: int, most: int, cells: PatchGrid, rule: InsertionRule) -> int:
    """Lower the distances around the occupied cells of some patches; return the first patch left out.

    Patches are counted along the rows of the table, from `first` on. It stops after about `most` occupied
    cells, or where the pool may have too few patches.
    """
    (rows, cols), pool, found = cells.table.shape, cells.pool, 0
    for place in range(first, rows * cols):
        pr, pc = place // cols, place % cols
        patch = cells.table[pr, pc]
        if patch == 0:
            continue
        if found >= most or pool.free_count[0] < AROUND:
            return place
        hits, misses = pool.hits[patch], pool.misses[patch]
        for r in range(SIDE):
            for c in range(SIDE):
                if is_occupied(int(hits[r, c]), int(misses[r, c]), rule.occupied_fraction):
                    add_obstacle(pr * SIDE + r, pc * SIDE + c, cells.table, pool, rule)
                    found += 1
    return int(rows * cols)
