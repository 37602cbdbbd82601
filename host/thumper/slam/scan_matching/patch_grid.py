"""One map in patches, as the kernels see it."""

import math
import mmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from thumper.common.numba_kernel import kernel, member
from thumper.slam.scan_matching.distance_field import (
    FieldArray,
    LevelArray,
    distance_at,
    field_shape,
    is_known,
)
from thumper.slam.scan_matching.patches import MASK, SIDE, SIDE_BITS, IndexArray, Pool, empty_pool, writable

# Anonymous memory on Windows is private anyway, and mmap has no flags there.
PRIVATE = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}


class PatchGrid(NamedTuple):
    """The cells of one map. Its cell [0, 0] is cell [row, col] of the table's."""

    table: IndexArray  # patch numbers, shape (patch rows, patch columns)
    pool: Pool
    row: int
    col: int


class PatchField(NamedTuple):
    """The distance field of one map."""

    table: IndexArray
    level: LevelArray  # squared distances in cells, shape (patches, SIDE, SIDE)
    metres: FieldArray  # distance by level
    row: int
    col: int
    shape: tuple[int, int]
    resolution_m: float
    max_distance_m: float


@member(distance_at, PatchField)
def _distance_in_patch(field: PatchField, row: int, col: int) -> float:
    r, c = row + field.row, col + field.col
    patch = field.table[r >> SIDE_BITS, c >> SIDE_BITS]
    return field.metres[field.level[patch, r & MASK, c & MASK]]  # type: ignore[no-any-return]


@member(field_shape, PatchField)
def _shape_of_field(field: PatchField) -> tuple[int, int]:
    return field.shape


@member(is_known, PatchGrid)
def _is_crossed(cells: PatchGrid, row: int, col: int) -> bool:
    r, c = row + cells.row, col + cells.col
    return cells.pool.misses[cells.table[r >> SIDE_BITS, c >> SIDE_BITS], r & MASK, c & MASK] > 0  # type: ignore[no-any-return]


@kernel
def plain(cells: PatchGrid, source: LevelArray, shape: tuple[int, int]) -> NDArray[Any]:
    """Return the map's cells of one of the pool's arrays in one array of this shape."""
    found = np.full(shape, source[0, 0, 0])
    for row in range(shape[0]):
        r = row + cells.row
        for pc in range(cells.table.shape[1]):
            patch = cells.table[r >> SIDE_BITS, pc]
            if patch != 0:
                first = pc * SIDE - cells.col
                left, right = max(0, first), min(shape[1], first + SIDE)
                found[row, left:right] = source[patch, r & MASK, left - first : right - first]
    return found


@kernel
def make_patches(visited: NDArray[np.int32], reach: int, cells: PatchGrid) -> bool:
    """Give a patch to all ground up to `reach` cells from those visited, (row, column), shape (n, 2).

    Returns false if the pool has too few: then let it grow, and call again.
    """
    table, pool = cells.table, cells.pool
    for i in range(visited.shape[0]):
        row, col = visited[i, 0] + cells.row, visited[i, 1] + cells.col
        for pr in range((row - reach) >> SIDE_BITS, ((row + reach) >> SIDE_BITS) + 1):
            for pc in range((col - reach) >> SIDE_BITS, ((col + reach) >> SIDE_BITS) + 1):
                if table[pr, pc] == 0:
                    if pool.free_count[0] == 0:
                        return False
                    writable(table, pr, pc, pool)
    return True


def own_memory(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return zeros that take memory when they are written; it returns to the system (malloc keeps it)."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    return np.ndarray(shape, dtype, buffer=mmap.mmap(-1, size, **PRIVATE) if size else None)


def larger_pool(pool: Pool, far: np.generic) -> Pool:
    """Return a copy of the pool with twice the room. No patch may have been freed, or be shared.

    `far` is the level of the largest distance.
    """
    patches = pool.references.size - 1
    used = patches - int(pool.free_count[0]) + 1
    new = empty_pool(2 * patches, far, distances=bool(pool.distance.shape[1]), zeros=own_memory)
    for name in ("hits", "misses", "distance", "references", "has_hits"):
        getattr(new, name)[:used] = getattr(pool, name)[:used]
    new.free_count[0] -= used - 1
    return new


def grown_table(table: IndexArray, shape: tuple[int, int], top: int, left: int) -> IndexArray:
    """Return tables, shape (..., *shape), with the old ones, shape (..., rows, columns), at [top, left]."""
    rows, cols = table.shape[-2:]
    new = np.zeros((*table.shape[:-2], *shape), np.int32)
    new[..., top : top + rows, left : left + cols] = table
    return new


def patches_over(first: int, end: int) -> tuple[int, int]:
    """Return the first patch that holds cell `first`, and the number of patches up to cell `end`."""
    return first >> SIDE_BITS, -(-end // SIDE) - (first >> SIDE_BITS)
