"""What only maps of many particles do with their patches: share, copy and draw them."""

import numpy as np

from thumper.common.numba_kernel import kernel
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, CellArray
from thumper.slam.scan_matching.patches import SIDE, IndexArray, Pool


def grow(pool: Pool, extra: int) -> None:
    """Add `extra` free patches, in place: a copy would take twice the memory for a moment.

    No view of the pool's arrays may exist at that time.
    """
    before, free = pool.references.size, int(pool.free_count[0])
    for patches in (pool.hits, pool.misses, pool.distance):
        patches.resize((before + extra, *patches.shape[1:]), refcheck=False)
    pool.references.resize(before + extra, refcheck=False)
    pool.has_hits.resize(before + extra, refcheck=False)
    pool.free.resize(before + extra, refcheck=False)
    pool.free[free : free + extra] = np.arange(before + extra - 1, before - 1, -1)
    pool.free_count[0] += extra


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
