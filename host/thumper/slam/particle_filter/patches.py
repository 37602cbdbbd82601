"""Maps of many particles as square patches, shared until one of their owners writes (copy on write).

A particle's map is a table of patch numbers. Copying a particle copies its table and adds one reference to
each patch. A patch with more than one reference is duplicated when it is written. Patch 0 is unknown space:
it is never written and belongs to all particles.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, CellArray
from thumper.slam.scan_matching.distance_field import ByteArray

SIDE_BITS = 5
SIDE = 1 << SIDE_BITS  # cells along a patch; a power of two, so that indices split by shift and mask
MASK = SIDE - 1
FAR = 255  # quantized distance: no occupied cell within the largest distance

IndexArray = NDArray[np.int32]


class Pool(NamedTuple):
    """All patches of all particles. Numba passes a named tuple of arrays as it is."""

    hits: ByteArray  # shape (patches, SIDE, SIDE)
    misses: ByteArray
    distance: ByteArray  # to the nearest occupied cell, 0...254 up to the largest distance, or FAR
    references: IndexArray  # shape (patches,)
    has_hits: ByteArray  # whether any of the hits is not 0, shape (patches,)
    free: IndexArray  # a stack of free patch numbers, of which the first `free_count[0]` are valid
    free_count: IndexArray  # shape (1,)


def empty_pool(patches: int) -> Pool:
    """Return a pool with `patches` free patches, and patch 0."""
    shape = (patches + 1, SIDE, SIDE)
    return Pool(
        hits=np.zeros(shape, dtype=np.uint8),
        misses=np.zeros(shape, dtype=np.uint8),
        distance=np.full(shape, FAR, dtype=np.uint8),
        references=np.zeros(patches + 1, dtype=np.int32),
        has_hits=np.zeros(patches + 1, dtype=np.uint8),
        free=np.arange(patches, -1, -1, dtype=np.int32),  # the last entry, 0, is beyond the stack's top
        free_count=np.array([patches], dtype=np.int32),
    )


def grow(pool: Pool, extra: int) -> None:
    """Add `extra` free patches, in place: a copy would take twice the memory for a moment.

    No view of the pool's arrays may exist at that time.
    """
    before, free = pool.references.size, int(pool.free_count[0])
    for patches in (pool.hits, pool.misses, pool.distance):
        patches.resize((before + extra, SIDE, SIDE), refcheck=False)
    pool.distance[before:] = FAR
    pool.references.resize(before + extra, refcheck=False)
    pool.has_hits.resize(before + extra, refcheck=False)
    pool.free.resize(before + extra, refcheck=False)
    pool.free[free : free + extra] = np.arange(before + extra - 1, before - 1, -1)
    pool.free_count[0] += extra


@kernel
def writable(table: IndexArray, patch_row: int, patch_col: int, pool: Pool) -> int:
    """Return the number of the patch at this position, which from now on belongs to this table alone."""
    old = table[patch_row, patch_col]
    if old != 0 and pool.references[old] == 1:
        return int(old)
    pool.free_count[0] -= 1
    new = pool.free[pool.free_count[0]]
    pool.hits[new] = pool.hits[old]
    pool.misses[new] = pool.misses[old]
    pool.distance[new] = pool.distance[old]
    pool.references[new], pool.has_hits[new] = 1, pool.has_hits[old]
    if old != 0:
        pool.references[old] -= 1
    table[patch_row, patch_col] = new
    return int(new)


@kernel
def copy_tables(tables: IndexArray, parents: IndexArray, pool: Pool) -> None:
    """Copy the map of particle `parents[k]` to particle k. `parents[k] == k` for every surviving parent."""
    rows, cols = tables.shape[1], tables.shape[2]
    for k in range(parents.size):
        parent = parents[k]
        if parent == k:
            continue
        for r in range(rows):
            for c in range(cols):
                old, new = tables[k, r, c], tables[parent, r, c]
                if old == new:
                    continue
                if new != 0:
                    pool.references[new] += 1
                if old != 0:
                    pool.references[old] -= 1
                    if pool.references[old] == 0:
                        pool.free[pool.free_count[0]] = old
                        pool.free_count[0] += 1
                tables[k, r, c] = new


@kernel
def render(table: IndexArray, source: ByteArray, unknown: int) -> ByteArray:
    """Return one particle's cells as a plain array, shape (rows * SIDE, columns * SIDE)."""
    rows, cols = table.shape
    out = np.full((rows * SIDE, cols * SIDE), unknown, dtype=np.uint8)
    for r in range(rows):
        for c in range(cols):
            if table[r, c] != 0:
                out[r * SIDE : (r + 1) * SIDE, c * SIDE : (c + 1) * SIDE] = source[table[r, c]]
    return out


@kernel
def render_occupancy(table: IndexArray, pool: Pool) -> CellArray:
    """Return one particle's cells as free, occupied or unknown. A cell at distance 0 is occupied."""
    rows, cols = table.shape
    out = np.full((rows * SIDE, cols * SIDE), UNKNOWN, dtype=np.int8)
    for r in range(rows):
        for c in range(cols):
            patch = table[r, c]
            if patch == 0:
                continue
            for i in range(SIDE):
                for j in range(SIDE):
                    if pool.hits[patch, i, j] > 0 or pool.misses[patch, i, j] > 0:
                        state = OCCUPIED if pool.distance[patch, i, j] == 0 else FREE
                        out[r * SIDE + i, c * SIDE + j] = state
    return out
