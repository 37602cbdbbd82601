"""Free space in patched maps: the cells that beams crossed, entered eight at a time.

What the beams crossed is painted once for all particles that see the same; entering it is then arithmetic on
whole words (SWAR: Warren, "Hacker's Delight", chapter 2).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel
from thumper.slam.grid.ray_casting import CrossedArray
from thumper.slam.grid.scan_inserter import COUNT_MAX
from thumper.slam.particle_filter.patches import SIDE, SIDE_BITS, IndexArray
from thumper.slam.scan_matching.distance_field import ByteArray

PASSED, ENDED = 1, 2  # bits of a cell of the layer: a beam went through it, a beam ended in it

WIDTH = SIDE // 8  # of a patch, in words

WordArray = NDArray[np.uint64]

ONE = np.uint64(0x0101010101010101)  # in each of the eight bytes
LOW = np.uint64(0x7F7F7F7F7F7F7F7F)
TO_CARRY = np.uint64(0x0101010101010101 * (0xFF - COUNT_MAX))  # a byte's low bits carry from COUNT_MAX + 1 on
TOP = np.uint64(7)  # a byte's highest bit, by how far it is shifted down


class FreeSpaceMask(NamedTuple):
    """The patches that beams crossed."""

    places: IndexArray  # row and column in the tables, shape (n, 2)
    words: WordArray  # PASSED or 0 for each cell, eight a word, shape (n, SIDE * SIDE / 8)


@kernel
def painted(crossed: CrossedArray, layer: ByteArray) -> FreeSpaceMask:
    """The patches of the cells crossed, shape (cells, 2), which bear PASSED in the layer.

    `layer`, shape (rows * SIDE, columns * SIDE), has one byte a cell of the tables, and bears nothing else.
    """
    rows, cols = layer.shape[0] >> SIDE_BITS, layer.shape[1] >> SIDE_BITS
    listed = np.zeros((rows, cols), dtype=np.bool_)
    places, n = np.empty((min(crossed.shape[0], rows * cols), 2), dtype=np.int32), 0
    last_row = last_col = -1
    for i in range(crossed.shape[0]):
        row, col = crossed[i, 0] >> SIDE_BITS, crossed[i, 1] >> SIDE_BITS
        if row == last_row and col == last_col:
            continue
        last_row, last_col = row, col
        if not listed[row, col]:
            listed[row, col] = True
            places[n, 0], places[n, 1] = row, col
            n += 1
    words, layer_words = np.empty((n, SIDE * WIDTH), dtype=np.uint64), layer.view(np.uint64)
    for i in range(n):
        for r in range(SIDE):
            for w in range(WIDTH):
                words[i, r * WIDTH + w] = layer_words[places[i, 0] * SIDE + r, places[i, 1] * WIDTH + w]
    return FreeSpaceMask(places[:n], words)


@kernel
def wipe(places: IndexArray, layer: ByteArray) -> None:
    """Empty the layer in these patches."""
    words = layer.view(np.uint64)
    for i in range(places.shape[0]):
        for r in range(places[i, 0] * SIDE, places[i, 0] * SIDE + SIDE):
            for w in range(places[i, 1] * WIDTH, places[i, 1] * WIDTH + WIDTH):
                words[r, w] = 0


@kernel
def hit_and_passed(passed: np.uint64, hits: np.uint64) -> np.uint64:
    """Of eight cells, a one in the byte of those that were passed and have ever been hit."""
    return passed & ((((hits & LOW) + LOW) | hits) >> TOP) & ONE


@kernel
def count_misses(passed: WordArray, hits: WordArray, misses: WordArray) -> bool:
    """Add one to the misses of the cells that were passed and never hit, up to `COUNT_MAX`.

    All three are of one patch, shape (SIDE * SIDE / 8,). Return whether a cell was passed that had been hit:
    such a cell may change its state, and is left to the caller. There are no branches: the compiler makes
    vectors of it.
    """
    left = np.uint64(0)
    for i in range(passed.size):
        rest = hit_and_passed(passed[i], hits[i])
        left |= rest
        count = misses[i] + (passed[i] ^ rest)
        misses[i] = count - (((((count & LOW) + TO_CARRY) & count) >> TOP) & ONE)
    return bool(left)


@kernel
def all_round(places: IndexArray, cells: IndexArray, rows: int, cols: int) -> IndexArray:
    """Patches, shape (n, 2), of the places and of the cells, (row, column) each, and the eight round each."""
    listed = np.zeros((rows, cols), dtype=np.bool_)
    found, n = np.empty((rows * cols, 2), dtype=np.int32), 0
    last_row = last_col = -1
    for i in range(places.shape[0] + cells.shape[0]):
        if i < places.shape[0]:
            row, col = int(places[i, 0]), int(places[i, 1])
        else:
            cell = cells[i - places.shape[0]]
            row, col = cell[0] >> SIDE_BITS, cell[1] >> SIDE_BITS
        if row == last_row and col == last_col:
            continue
        last_row, last_col = row, col
        for r in range(max(0, row - 1), min(rows, row + 2)):
            for c in range(max(0, col - 1), min(cols, col + 2)):
                if not listed[r, c]:
                    listed[r, c] = True
                    found[n, 0], found[n, 1] = r, c
                    n += 1
    return found[:n]
