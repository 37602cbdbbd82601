"""Entering a scan into patched maps, and keeping the quantised distance to the nearest occupied cell."""

import math

import numpy as np

from thumper.geometry import FloatArray
from thumper.kernel import kernel
from thumper.mapping.patches import FAR, MASK, SIDE, SIDE_BITS, ByteArray, IndexArray, Pool, writable
from thumper.mapping.scan_points import HIT, KindArray
from thumper.mapping.trace import StampArray, trace

COUNT_MAX = 250  # both counts are halved beyond this: the fraction stays, and old evidence fades


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
    side, n_lost, n_walls = 2 * reach + 1, 0, 0
    lost = np.empty((side * side, 2), dtype=np.int32)
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
                        lost[n_lost, 0], lost[n_lost, 1] = r, c
                        n_lost += 1
                        top, bottom = min(top, r), max(bottom, r)
                        left, right = min(left, c), max(right, c)
    top, bottom, left, right = top - reach, bottom + reach, left - reach, right + reach
    wall_rows = np.empty((4 * reach + 1) * (4 * reach + 1), dtype=np.int32)
    wall_cols = np.empty_like(wall_rows)
    for pr in range(top >> SIDE_BITS, (bottom >> SIDE_BITS) + 1):
        for pc in range(left >> SIDE_BITS, (right >> SIDE_BITS) + 1):
            near = pool.near[table[pr, pc]]
            for r in range(max(top, pr * SIDE), min(bottom + 1, (pr + 1) * SIDE)):
                for c in range(max(left, pc * SIDE), min(right + 1, (pc + 1) * SIDE)):
                    if near[r & MASK, c & MASK] == 0:
                        wall_rows[n_walls], wall_cols[n_walls] = r, c
                        n_walls += 1
    for i in range(n_lost):
        r, c, best = lost[i, 0], lost[i, 1], reach * reach
        for j in range(n_walls):
            best = min(best, (wall_rows[j] - r) ** 2 + (wall_cols[j] - c) ** 2)
        pool.near[table[r >> SIDE_BITS, c >> SIDE_BITS], r & MASK, c & MASK] = levels[best]


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
    before = _is_wall(hits, misses, occupied_fraction)
    if hits >= COUNT_MAX or misses >= COUNT_MAX:
        hits, misses = hits // 2, misses // 2
    if hit:
        hits += 1
    else:
        misses += 1
    pool.hits[patch, r, c], pool.misses[patch, r, c] = hits, misses
    after = _is_wall(hits, misses, occupied_fraction)
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
    stamp: IndexArray,
    stamps: StampArray,
    need: int,
    tables: IndexArray,
    pool: Pool,
    stencil: ByteArray,
    levels: ByteArray,
    reach: int,
    occupied_fraction: float,
) -> int:
    """Enter one scan into the maps of particles `order[first:]`; return how many of `order` are done.

    All lengths are in cells, `poses` and `middles`, shape (particles, 3), from the tables' corner. The hits
    are entered as seen from a particle's own pose. Free space is cleared as seen from its group's middle,
    with the same cells for all that have it in common: they differ by less than a cell, and must come one
    after the other in `order`. It is cleared along one beam in `clear_every`, from `clear_from` on, which the
    caller turns over: neighbouring beams cross the same cells.

    The kernel stops before a particle when fewer than `need` patches are free: the caller grows the pool and
    calls again. `stamps` lets each cell count once a scan, a hit before beams that pass: the tables' cells,
    folded into a square whose side is a power of two; `stamp`, shape (1,), is the newest in use.
    """
    fold = stamps.shape[0] - 1
    hits, misses, near, references = pool.hits, pool.misses, pool.near, pool.references
    placed_origins, placed = np.empty_like(origins), np.empty_like(ends)
    crossed, traced = np.empty((0, 2), dtype=np.int32), -1
    for done in range(first, order.size):
        if pool.size[0] < need:
            return done
        k = order[done]
        if traced < 0 or not np.array_equal(middles[k], middles[traced]):
            _place(origins, middles[k], placed_origins)
            _place(ends, middles[k], placed)
            stamp[0] += 1
            crossed = trace(placed_origins, placed, kinds, clear_from, clear_every, stamp[0], stamps, fold)
            traced = k
        stamp[0] += 1
        table, mine = tables[k], stamp[0]
        _place(ends, poses[k], placed)
        for i in range(kinds.size):
            if kinds[i] == HIT:
                row, col = math.floor(placed[i, 1]), math.floor(placed[i, 0])
                if stamps[row & fold, col & fold] == mine:
                    continue
                stamps[row & fold, col & fold] = mine
                patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
                if near[patch, r, c] == 0 and references[patch] == 1 and hits[patch, r, c] < COUNT_MAX:
                    hits[patch, r, c] += 1  # a wall stays a wall: no call, which costs more than the count
                else:
                    _count(row, col, True, table, pool, stencil, levels, reach, occupied_fraction)
        patch_row = patch_col = -1
        patch = 0
        for i in range(crossed.shape[0]):
            row, col = crossed[i, 0], crossed[i, 1]
            if stamps[row & fold, col & fold] == mine:
                continue
            # Count here what changes no cell's state: a call costs more, for its reference counting.
            if row >> SIDE_BITS != patch_row or col >> SIDE_BITS != patch_col:
                patch_row, patch_col = row >> SIDE_BITS, col >> SIDE_BITS
                patch = table[patch_row, patch_col]
                if patch == 0 or references[patch] != 1:
                    patch = writable(table, patch_row, patch_col, pool)
            r, c = row & MASK, col & MASK
            missed = int(misses[patch, r, c]) + 1
            if hits[patch, r, c] == 0:
                misses[patch, r, c] = min(missed, COUNT_MAX)
            elif missed < COUNT_MAX and (
                near[patch, r, c] != 0 or _is_wall(int(hits[patch, r, c]), missed, occupied_fraction)
            ):
                misses[patch, r, c] = missed
            else:
                _count(row, col, False, table, pool, stencil, levels, reach, occupied_fraction)
    return int(order.size)
