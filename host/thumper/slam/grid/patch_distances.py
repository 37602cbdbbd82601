"""The distance field of patched maps: the blocks of `distance_field`, one for each patch."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import (
    ByteArray,
    InsertionRule,
    LostCells,
    list_lost_cells,
    lost_cells,
    lower_to_obstacles,
    lower_to_stencil,
    search_box,
)
from thumper.slam.scan_matching.patches import FAR, MASK, SIDE, SIDE_BITS, IndexArray, Pool, writable

# An occupied cell becomes free below this part of `occupied_fraction`. With one limit for both, its edge
# would flicker.
RELEASE = 0.7


def squared_distances(max_distance_cells: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Return the table from squared distance in cells to the same, cut off at the largest distance."""
    most = max_distance_cells * max_distance_cells
    return np.minimum(np.arange(2 * most + 1), most).astype(np.min_scalar_type(most))


def quantized_distances(max_distance_cells: int) -> ByteArray:
    """Return the table from squared distance in cells to 0...254, and FAR from the largest distance on."""
    squared = np.arange(2 * max_distance_cells * max_distance_cells + 1)
    level = np.floor(254.0 * np.sqrt(squared) / max_distance_cells)
    return np.where(squared < max_distance_cells * max_distance_cells, level, FAR).astype(np.uint8)


@kernel
def add_obstacle(row: int, col: int, table: IndexArray, pool: Pool, rule: InsertionRule) -> None:
    """Lower the distances around a cell that became occupied."""
    reach = rule.max_distance_cells
    for pr in range((row - reach) >> SIDE_BITS, ((row + reach) >> SIDE_BITS) + 1):
        top, bottom = max(row - reach, pr * SIDE), min(row + reach + 1, (pr + 1) * SIDE)
        for pc in range((col - reach) >> SIDE_BITS, ((col + reach) >> SIDE_BITS) + 1):
            left, right = max(col - reach, pc * SIDE), min(col + reach + 1, (pc + 1) * SIDE)
            patch = pool.distance[writable(table, pr, pc, pool)]
            near = patch[top - pr * SIDE : bottom - pr * SIDE, left - pc * SIDE : right - pc * SIDE]
            lower_to_stencil(near, rule.stencil[top - row + reach :, left - col + reach :])


@kernel
def remove_obstacle(row: int, col: int, table: IndexArray, pool: Pool, rule: InsertionRule) -> None:
    """Recompute the distances around a cell that became free."""
    patch = writable(table, row >> SIDE_BITS, col >> SIDE_BITS, pool)
    pool.distance[patch, row & MASK, col & MASK] = rule.levels[-1]
    lost = _list_lost_cells(row, col, table, pool, rule)
    top, bottom, left, right = search_box(lost, rule.max_distance_cells)
    rows, cols = table.shape
    for pr in range(max(0, top >> SIDE_BITS), min(rows, (bottom >> SIDE_BITS) + 1)):
        first, last = max(top - pr * SIDE, 0), min(bottom + 1 - pr * SIDE, SIDE)
        for pc in range(max(0, left >> SIDE_BITS), min(cols, (right >> SIDE_BITS) + 1)):
            # All columns of the patch: obstacles further away change nothing, and whole rows are faster.
            block = pool.distance[table[pr, pc]][first:last]
            lower_to_obstacles(block, (pr * SIDE + first, pc * SIDE), lost)
    for i in range(lost.rows.size):
        r, c = int(lost.rows[i]), int(lost.cols[i])
        patch = table[r >> SIDE_BITS, c >> SIDE_BITS]
        pool.distance[patch, r & MASK, c & MASK] = rule.levels[int(lost.squared[i])]


@kernel
def _list_lost_cells(row: int, col: int, table: IndexArray, pool: Pool, rule: InsertionRule) -> LostCells:
    """Return the cells whose distance may be to the removed obstacle; their patches are writable then."""
    reach, lost, n = rule.max_distance_cells, lost_cells(rule.max_distance_cells), 1
    lost.rows[0], lost.cols[0] = row, col
    for pr in range((row - reach) >> SIDE_BITS, ((row + reach) >> SIDE_BITS) + 1):
        top, bottom = max(row - reach, pr * SIDE), min(row + reach + 1, (pr + 1) * SIDE)
        for pc in range((col - reach) >> SIDE_BITS, ((col + reach) >> SIDE_BITS) + 1):
            left, right = max(col - reach, pc * SIDE), min(col + reach + 1, (pc + 1) * SIDE)
            patch = pool.distance[table[pr, pc]]
            near = patch[top - pr * SIDE : bottom - pr * SIDE, left - pc * SIDE : right - pc * SIDE]
            around = rule.stencil[top - row + reach :, left - col + reach :]
            before = n
            n = list_lost_cells(near, around, rule.levels[-1], (top, left), lost, n)
            if n > before:
                writable(table, pr, pc, pool)
    return LostCells(lost.rows[:n], lost.cols[:n], lost.squared[:n])
