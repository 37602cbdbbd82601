"""Entering a scan into patched maps, and keeping the quantised distance to the nearest occupied cell."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT, KindArray
from thumper.slam.grid.ray_casting import trace
from thumper.slam.grid.scan_inserter import COUNT_MAX
from thumper.slam.particle_filter.patch_free_space import (
    ENDED,
    PASSED,
    WordArray,
    all_round,
    count_misses,
    hit_and_passed,
    painted,
    wipe,
)
from thumper.slam.particle_filter.patches import (
    FAR,
    MASK,
    SIDE,
    SIDE_BITS,
    IndexArray,
    Pool,
    writable,
)
from thumper.slam.scan_matching.distance_field import ByteArray, FieldArray

RELEASE = 0.7  # a wall turns free below this part of `occupied_fraction`: at one limit its edge would flicker


def quantised_distances(reach: int) -> ByteArray:
    """Table from squared distance in cells to 0...254, and FAR from the reach on; shape (2 reach^2 + 1,)."""
    squared = np.arange(2 * reach * reach + 1)
    level = np.floor(254.0 * np.sqrt(squared) / reach)
    return np.where(squared < reach * reach, level, FAR).astype(np.uint8)


def distance_stencil(reach: int) -> ByteArray:
    """The quantised distances round an occupied cell, shape (2 reach + 1, 2 reach + 1)."""
    squared = np.arange(-reach, reach + 1) ** 2
    return np.asarray(quantised_distances(reach)[squared[:, np.newaxis] + squared])


@kernel
def _is_wall(hits: int, misses: int, occupied_fraction: float) -> bool:
    return hits > 0 and hits >= occupied_fraction * (hits + misses)


@kernel
def _mark(row: int, col: int, table: IndexArray, pool: Pool, stencil: ByteArray, reach: int) -> None:
    """The cell has turned occupied: lower the distances round it, patch by patch."""
    for pr in range((row - reach) >> SIDE_BITS, ((row + reach) >> SIDE_BITS) + 1):
        top, bottom = max(row - reach, pr * SIDE), min(row + reach + 1, (pr + 1) * SIDE)
        for pc in range((col - reach) >> SIDE_BITS, ((col + reach) >> SIDE_BITS) + 1):
            left, right = max(col - reach, pc * SIDE), min(col + reach + 1, (pc + 1) * SIDE)
            near = pool.near[writable(table, pr, pc, pool), top & MASK :, left & MASK :]
            round_it = stencil[top - row + reach :, left - col + reach :]
            for r in range(bottom - top):  # without branches: the compiler makes vectors of it
                for c in range(right - left):
                    level, old = round_it[r, c], near[r, c]
                    near[r, c] = level if level < old else old


@kernel
def _has_zero_byte(word: np.uint64) -> bool:
    """Whether one of the eight bytes is 0 (Mycroft's test)."""
    return bool((word - np.uint64(0x0101010101010101)) & ~word & np.uint64(0x8080808080808080))


@kernel
def _nearer(row: int, col: int, rows: FieldArray, cols: FieldArray, squared: FieldArray) -> None:
    """Lower the squared distances of cells to that of a wall."""
    wall_row, wall_col = np.float32(row), np.float32(col)
    for i in range(rows.size):
        dr, dc = rows[i] - wall_row, cols[i] - wall_col
        found, old = dr * dr + dc * dc, squared[i]
        squared[i] = found if found < old else old


@kernel
def _unmark(
    row: int,
    col: int,
    table: IndexArray,
    pool: Pool,
    stencil: ByteArray,
    levels: ByteArray,
    reach: int,
) -> None:
    """The cell has turned free: forget the distances that may be to it and find the next nearest cells.

    A cell is occupied exactly where the level is 0, so the neighbourhood is read from the levels alone.
    """
    side, n_lost = 2 * reach + 1, 0
    lost_rows = np.empty(side * side, dtype=np.float32)  # float32, of which the compiler makes vectors
    lost_cols, best = np.empty_like(lost_rows), np.empty_like(lost_rows)
    top, bottom, left, right = row, row, col, col
    for pr in range((row - reach) >> SIDE_BITS, ((row + reach) >> SIDE_BITS) + 1):
        for pc in range((col - reach) >> SIDE_BITS, ((col + reach) >> SIDE_BITS) + 1):
            patch, own = int(table[pr, pc]), False
            for r in range(max(row - reach, pr * SIDE), min(row + reach + 1, (pr + 1) * SIDE)):
                for c in range(max(col - reach, pc * SIDE), min(col + reach + 1, (pc + 1) * SIDE)):
                    level = stencil[r - row + reach, c - col + reach]
                    if level != FAR and pool.near[patch, r & MASK, c & MASK] == level:
                        if not own:
                            patch, own = writable(table, pr, pc, pool), True
                        pool.near[patch, r & MASK, c & MASK] = FAR
                        lost_rows[n_lost], lost_cols[n_lost], best[n_lost] = r, c, reach * reach
                        n_lost += 1
                        top, bottom = min(top, r), max(bottom, r)
                        left, right = min(left, c), max(right, c)
    top, bottom, left, right = top - reach, bottom + reach, left - reach, right + reach
    for pr in range(top >> SIDE_BITS, (bottom >> SIDE_BITS) + 1):
        for pc in range(left >> SIDE_BITS, (right >> SIDE_BITS) + 1):
            near, first, last = pool.near[table[pr, pc]], pc * SIDE, (pc + 1) * SIDE - 1
            words = near.view(np.uint64)  # eight cells at a time: few hold a wall
            for r in range(max(top, pr * SIDE), min(bottom + 1, (pr + 1) * SIDE)):
                for w in range((max(left, first) & MASK) >> 3, ((min(right, last) & MASK) >> 3) + 1):
                    if not _has_zero_byte(words[r & MASK, w]):
                        continue
                    for c in range(8 * w, 8 * w + 8):
                        if near[r & MASK, c] == 0:
                            _nearer(r, first + c, lost_rows[:n_lost], lost_cols, best)
    for i in range(n_lost):
        r, c = int(lost_rows[i]), int(lost_cols[i])
        pool.near[table[r >> SIDE_BITS, c >> SIDE_BITS], r & MASK, c & MASK] = levels[int(best[i])]


@kernel
def _count(
    row: int,
    col: int,
    hit: bool,
    table: IndexArray,
    pool: Pool,
    stencil: ByteArray,
    levels: ByteArray,
    reach: int,
    occupied_fraction: float,
) -> None:
    patch = writable(table, row >> SIDE_BITS, col >> SIDE_BITS, pool)
    r, c = row & MASK, col & MASK
    hits, misses = int(pool.hits[patch, r, c]), int(pool.misses[patch, r, c])
    before = pool.near[patch, r, c] == 0
    if hits >= COUNT_MAX or misses >= COUNT_MAX:
        hits, misses = hits // 2, misses // 2
    if hit:
        hits += 1
        pool.struck[patch] = True
    else:
        misses += 1
    pool.hits[patch, r, c], pool.misses[patch, r, c] = hits, misses
    after = _is_wall(hits, misses, (RELEASE if before else 1.0) * occupied_fraction)
    if after and not before:
        _mark(row, col, table, pool, stencil, reach)
    elif before and not after:
        _unmark(row, col, table, pool, stencil, levels, reach)


@kernel
def _place(points: FloatArray, pose: FloatArray, placed: FloatArray) -> None:
    """The robot's points, shape (n, 2) in cells, as seen from a pose in cells and radians."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        placed[i, 0] = pose[0] + cos * points[i, 0] - sin * points[i, 1]
        placed[i, 1] = pose[1] + sin * points[i, 0] + cos * points[i, 1]


@kernel
def _cells_at(points: FloatArray, pose: FloatArray, cells: IndexArray) -> None:
    """(row, column) of the cells that hold the robot's points, shape (n, 2), as seen from a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        cells[i, 0] = math.floor(pose[1] + sin * points[i, 0] + cos * points[i, 1])
        cells[i, 1] = math.floor(pose[0] + cos * points[i, 0] - sin * points[i, 1])


@kernel
def _count_rest(
    place: IndexArray,
    passed: WordArray,
    layer: ByteArray,
    table: IndexArray,
    pool: Pool,
    stencil: ByteArray,
    levels: ByteArray,
    reach: int,
    occupied_fraction: float,
) -> None:
    """Miss the cells of one patch that were passed, not ended in, and hit before: their state may change."""
    patch = table[place[0], place[1]]
    hits, misses, near = pool.hits[patch], pool.misses[patch], pool.near[patch]
    hit_words = hits.reshape(SIDE * SIDE).view(np.uint64)
    for i in range(passed.size):
        if not hit_and_passed(passed[i], hit_words[i]):
            continue
        r = 8 * i >> SIDE_BITS
        for c in range(8 * i & MASK, (8 * i & MASK) + 8):
            row, col = place[0] * SIDE + r, place[1] * SIDE + c
            if layer[row, col] != PASSED or hits[r, c] == 0:
                continue
            missed = int(misses[r, c]) + 1
            # Count here what changes no cell's state: a call costs more, for its reference counting.
            if missed < COUNT_MAX and (
                near[r, c] != 0 or _is_wall(int(hits[r, c]), missed, RELEASE * occupied_fraction)
            ):
                misses[r, c] = missed
            else:
                _count(row, col, False, table, pool, stencil, levels, reach, occupied_fraction)


@kernel
def _needed(writes: IndexArray, table: IndexArray, pool: Pool) -> int:
    """How many of the places, shape (n, 2), are not the table's own, and take a free patch when written."""
    n = 0
    for i in range(writes.shape[0]):
        patch = table[writes[i, 0], writes[i, 1]]
        n += patch == 0 or pool.references[patch] != 1
    return n


@kernel
def integrate_all(
    first: int,
    order: IndexArray,
    poses: FloatArray,
    middles: FloatArray,
    origins: FloatArray,
    ends: FloatArray,
    kinds: KindArray,
    clear_from: int,
    clear_every: int,
    layer: ByteArray,
    tables: IndexArray,
    pool: Pool,
    stencil: ByteArray,
    levels: ByteArray,
    reach: int,
    occupied_fraction: float,
) -> tuple[int, int]:
    """Enter one scan into the maps of particles `order[first:]`, as far as the free patches last.

    Return how many of `order` are done, and how many free patches the next one may need: the caller grows the
    pool and calls again.

    All lengths are in cells, `poses` and `middles`, shape (particles, 3), from the tables' corner. The hits
    are entered as seen from a particle's own pose. Free space is cleared as seen from its group's middle,
    with the same cells for all that have it in common: they differ by less than a cell, and must come one
    after the other in `order`. It is cleared along one beam in `clear_every`, from `clear_from` on, which the
    caller turns over: neighbouring beams cross the same cells.

    Each cell counts once a scan, a hit before beams that pass. `layer`, a byte for each of the tables' cells,
    tells them apart; it is empty before and after.
    """
    rows, cols = tables.shape[1], tables.shape[2]
    hits, near, references = pool.hits, pool.near, pool.references
    hit_words = hits.reshape((-1, SIDE * SIDE)).view(np.uint64)
    miss_words = pool.misses.reshape((-1, SIDE * SIDE)).view(np.uint64)
    seen = ends[kinds == HIT]
    placed_origins, placed_ends = np.empty_like(origins), np.empty_like(ends)
    cells = np.empty(seen.shape, dtype=np.int32)
    passed = painted(np.empty((0, 2), dtype=np.int32), layer)
    writes, traced = passed.places, -1
    for done in range(first, order.size):
        k = order[done]
        table = tables[k]
        if traced < 0 or not np.array_equal(middles[k], middles[traced]):
            wipe(passed.places, layer)
            _place(origins, middles[k], placed_origins)
            _place(ends, middles[k], placed_ends)
            crossed = trace(placed_origins, placed_ends, kinds, clear_from, clear_every, PASSED, layer)
            passed = painted(crossed, layer)
            # A particle's own hits are a cell off at most, and what is near them less than a patch.
            _cells_at(seen, middles[k], cells)
            writes = all_round(passed.places, cells, rows, cols)
            traced = k
        need = _needed(writes, table, pool)
        if pool.size[0] < need:
            wipe(passed.places, layer)
            return done, need
        _cells_at(seen, poses[k], cells)
        for i in range(cells.shape[0]):
            row, col = cells[i, 0], cells[i, 1]
            if layer[row, col] & ENDED:
                continue
            layer[row, col] |= ENDED
            patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
            if near[patch, r, c] == 0 and references[patch] == 1 and hits[patch, r, c] < COUNT_MAX:
                hits[patch, r, c] += 1  # a wall stays a wall: no call, which costs more than the count
            else:
                _count(row, col, True, table, pool, stencil, levels, reach, occupied_fraction)
        for i in range(passed.places.shape[0]):
            place, words = passed.places[i], passed.words[i]
            patch = table[place[0], place[1]]
            if patch == 0 or references[patch] != 1:
                patch = writable(table, place[0], place[1], pool)
            # Patch 0, which has no hits, stands for all that have none: it stays in the fast memory.
            if count_misses(words, hit_words[patch if pool.struck[patch] else 0], miss_words[patch]):
                _count_rest(place, words, layer, table, pool, stencil, levels, reach, occupied_fraction)
        for i in range(cells.shape[0]):
            layer[cells[i, 0], cells[i, 1]] &= PASSED
    wipe(passed.places, layer)
    return int(order.size), 0
