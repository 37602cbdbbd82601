"""Entering a scan into patched maps, and keeping the quantised distance to the nearest occupied cell."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.geometry import FloatArray
from thumper.kernel import kernel
from thumper.mapping.patches import FAR, MASK, SIDE, SIDE_BITS, ByteArray, IndexArray, Pool, writable
from thumper.mapping.scan_points import HIT, SILENT, KindArray

COUNT_MAX = 250  # both counts are halved beyond this: the fraction stays, and old evidence fades

StampArray = NDArray[np.int32]


def quantised_distances(reach: int) -> ByteArray:
    """Table from squared distance in cells to 0...254, and FAR from the reach on; shape (2 reach^2 + 1,)."""
    squared = np.arange(2 * reach * reach + 1)
    level = np.floor(254.0 * np.sqrt(squared) / reach)
    return np.where(squared < reach * reach, level, FAR).astype(np.uint8)


@kernel
def _is_wall(hits: int, misses: int, occupied_fraction: float) -> bool:
    return hits > 0 and hits >= occupied_fraction * (hits + misses)


@kernel
def _mark(row: int, col: int, table: IndexArray, pool: Pool, levels: ByteArray, reach: int) -> None:
    """The cell has turned occupied: lower the distances round it, patch by patch."""
    for pr in range((row - reach) >> SIDE_BITS, ((row + reach) >> SIDE_BITS) + 1):
        for pc in range((col - reach) >> SIDE_BITS, ((col + reach) >> SIDE_BITS) + 1):
            patch, own = int(table[pr, pc]), False
            for r in range(max(row - reach, pr * SIDE), min(row + reach + 1, (pr + 1) * SIDE)):
                for c in range(max(col - reach, pc * SIDE), min(col + reach + 1, (pc + 1) * SIDE)):
                    level = levels[(r - row) * (r - row) + (c - col) * (c - col)]
                    if level < pool.near[patch, r & MASK, c & MASK]:
                        if not own:
                            patch, own = writable(table, pr, pc, pool), True
                        pool.near[patch, r & MASK, c & MASK] = level


@kernel
def _unmark(row: int, col: int, table: IndexArray, pool: Pool, levels: ByteArray, reach: int) -> None:
    """The cell has turned free: forget the distances that may be to it and find the next nearest cells.

    A cell is occupied exactly where the level is 0, so the neighbourhood is read from the levels alone.
    """
    side, n_lost, n_walls = 2 * reach + 1, 0, 0
    lost = np.empty((side * side, 2), dtype=np.int32)
    for r in range(row - reach, row + reach + 1):
        for c in range(col - reach, col + reach + 1):
            level = levels[(r - row) * (r - row) + (c - col) * (c - col)]
            pr, pc = r >> SIDE_BITS, c >> SIDE_BITS
            if level != FAR and pool.near[table[pr, pc], r & MASK, c & MASK] == level:
                pool.near[writable(table, pr, pc, pool), r & MASK, c & MASK] = FAR
                lost[n_lost, 0], lost[n_lost, 1] = r, c
                n_lost += 1
    walls = np.empty(((4 * reach + 1) * (4 * reach + 1), 2), dtype=np.int32)
    for r in range(row - 2 * reach, row + 2 * reach + 1):
        for c in range(col - 2 * reach, col + 2 * reach + 1):
            if pool.near[table[r >> SIDE_BITS, c >> SIDE_BITS], r & MASK, c & MASK] == 0:
                walls[n_walls, 0], walls[n_walls, 1] = r, c
                n_walls += 1
    for i in range(n_lost):
        r, c, best = lost[i, 0], lost[i, 1], reach * reach
        for j in range(n_walls):
            best = min(best, (walls[j, 0] - r) ** 2 + (walls[j, 1] - c) ** 2)
        pool.near[table[r >> SIDE_BITS, c >> SIDE_BITS], r & MASK, c & MASK] = levels[best]


@kernel
def _count(
    row: int,
    col: int,
    hit: bool,
    table: IndexArray,
    pool: Pool,
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
        _mark(row, col, table, pool, levels, reach)
    elif before and not after:
        _unmark(row, col, table, pool, levels, reach)


@kernel
def integrate_all(
    first: int,
    poses: FloatArray,
    origins_m: FloatArray,
    ends_m: FloatArray,
    kinds: KindArray,
    clear_from: int,
    clear_every: int,
    resolution_m: float,
    stamp: int,
    stamps: StampArray,
    need: int,
    tables: IndexArray,
    pool: Pool,
    levels: ByteArray,
    reach: int,
    occupied_fraction: float,
) -> int:
    """Enter one scan into the maps of particles `first`...; return the first that was not done.

    `poses`, shape (particles, 3), are in metres from the tables' corner. The kernel stops before a particle
    when fewer than `need` patches are free: the caller grows the pool and calls again. Every hit counts; free
    space is cleared along one beam in `clear_every`, from `clear_from` on, which the caller turns over:
    neighbouring beams cross the same cells. `stamps` lets each cell count once a
    scan, a hit before beams that pass: the tables' cells, folded into a square whose side is a power of two.
    """
    fold = stamps.shape[0] - 1
    hits, misses, near, references = pool.hits, pool.misses, pool.near, pool.references
    for k in range(first, poses.shape[0]):
        if pool.size[0] < need:
            return k
        table, mine = tables[k], stamp + k
        cos, sin = math.cos(poses[k, 2]) / resolution_m, math.sin(poses[k, 2]) / resolution_m
        x, y = poses[k, 0] / resolution_m, poses[k, 1] / resolution_m
        for i in range(kinds.size):
            if kinds[i] == HIT:
                col = math.floor(x + cos * ends_m[i, 0] - sin * ends_m[i, 1])
                row = math.floor(y + sin * ends_m[i, 0] + cos * ends_m[i, 1])
                if stamps[row & fold, col & fold] == mine:
                    continue
                stamps[row & fold, col & fold] = mine
                patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
                if near[patch, r, c] == 0 and references[patch] == 1 and hits[patch, r, c] < COUNT_MAX:
                    hits[patch, r, c] += 1  # a wall stays a wall: no call, which costs more than the count
                else:
                    _count(row, col, True, table, pool, levels, reach, occupied_fraction)
        for i in range(clear_from, kinds.size, clear_every):
            if kinds[i] == SILENT:
                continue
            x0 = x + cos * origins_m[i, 0] - sin * origins_m[i, 1]
            y0 = y + sin * origins_m[i, 0] + cos * origins_m[i, 1]
            x1 = x + cos * ends_m[i, 0] - sin * ends_m[i, 1]
            y1 = y + sin * ends_m[i, 0] + cos * ends_m[i, 1]
            row, col, dx, dy = math.floor(y0), math.floor(x0), x1 - x0, y1 - y0
            step_col, step_row = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
            next_x = ((col + (dx > 0.0)) - x0) / dx if dx != 0.0 else math.inf
            next_y = ((row + (dy > 0.0)) - y0) / dy if dy != 0.0 else math.inf
            every_x = abs(1.0 / dx) if dx != 0.0 else math.inf
            every_y = abs(1.0 / dy) if dy != 0.0 else math.inf
            patch_row = patch_col = -1
            patch = 0
            for _ in range(abs(math.floor(y1) - row) + abs(math.floor(x1) - col)):
                if stamps[row & fold, col & fold] != mine:
                    stamps[row & fold, col & fold] = mine
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
                        _count(row, col, False, table, pool, levels, reach, occupied_fraction)
                if next_x < next_y:
                    next_x += every_x
                    col += step_col
                else:
                    next_y += every_y
                    row += step_row
    return int(poses.shape[0])
