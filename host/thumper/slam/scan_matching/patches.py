"""Maps as square patches: memory where beams have been, and growth that copies a table of patch numbers.

A map is a table of patch numbers. Patch 0 is unknown space: it is never written and belongs to all maps. The
particle filter's maps share patches until one of their owners writes (copy on write). Copying a particle
copies its table and adds one reference to each patch. A patch with more than one reference is duplicated when
it is written.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import ByteArray

SIDE_BITS = 5
SIDE = 1 << SIDE_BITS  # cells along a patch; a power of two, so that indices split by shift and mask
MASK = SIDE - 1
COUNT_MAX = 250  # both counts of a cell are halved from here on: the fraction stays, and old evidence fades
FAR = 255  # quantized distance: no occupied cell within the largest distance
FAR_LEVEL = np.uint8(FAR)

IndexArray = NDArray[np.int32]


class Pool(NamedTuple):
    """All patches of all maps. Numba passes a named tuple of arrays as it is."""

    hits: ByteArray  # shape (patches, SIDE, SIDE)
    misses: ByteArray
    distance: NDArray[Any]  # to the nearest occupied cell, by the insertion rule; may be (patches, 0, 0)
    references: IndexArray  # shape (patches,)
    has_hits: ByteArray  # whether any of the hits is not 0, shape (patches,)
    free: IndexArray  # a stack of free patch numbers, of which the first `free_count[0]` are valid
    free_count: IndexArray  # shape (1,)


def empty_pool(
    patches: int,
    far: np.generic = FAR_LEVEL,
    *,
    distances: bool = True,
    zeros: Callable[[tuple[int, ...], DTypeLike], NDArray[Any]] = np.zeros,
) -> Pool:
    """Return a pool with `patches` free patches, and patch 0; `far` is the level of the largest distance."""
    shape = (patches + 1, SIDE, SIDE)
    distance = zeros(shape if distances else (patches + 1, 0, 0), far.dtype)
    distance[0] = far  # the others get it when they are written
    return Pool(
        hits=zeros(shape, np.uint8),
        misses=zeros(shape, np.uint8),
        distance=distance,
        references=np.zeros(patches + 1, dtype=np.int32),
        has_hits=np.zeros(patches + 1, dtype=np.uint8),
        free=np.arange(patches, -1, -1, dtype=np.int32),  # the last entry, 0, is beyond the stack's top
        free_count=np.array([patches], dtype=np.int32),
    )


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
