"""Free space in patched maps: cells crossed by beams, inserted eight at a time.

Particles that see the same share the crossed cells. Inserting them is arithmetic on whole words (SWAR:
Warren, "Hacker's Delight", chapter 2).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel
from thumper.slam.grid.ray_casting import CrossedArray
from thumper.slam.scan_matching.distance_field import ByteArray
from thumper.slam.scan_matching.patches import COUNT_MAX, SIDE, SIDE_BITS, IndexArray

CROSSED, ENDED = 1, 2  # bits of a cell of the layer: a beam crossed it, a beam ended in it

WIDTH = SIDE // 8  # of a patch, in words

WordArray = NDArray[np.uint64]

ONE = np.uint64(0x0101010101010101)  # in each of the eight bytes
LOW = np.uint64(0x7F7F7F7F7F7F7F7F)
TO_CARRY = np.uint64(0x0101010101010101 * (0x100 - COUNT_MAX))  # a byte's low bits carry from COUNT_MAX on
TOP, BYTE, HALF = np.uint64(7), np.uint64(8), np.uint64(1)  # shifts: a byte's highest bit down, bytes, halves


class FreeSpaceMask(NamedTuple):
    """The patches crossed by beams."""

    patches: IndexArray  # row and column in the tables, shape (n, 2)
    words: WordArray  # CROSSED or 0 for each cell, eight per word, shape (n, SIDE * SIDE / 8)


@kernel
def free_space_mask(crossed: CrossedArray, layer: ByteArray) -> FreeSpaceMask:
    """Return the patches of the crossed cells, shape (cells, 2), which carry CROSSED in the layer.

    `layer`, shape (rows * SIDE, columns * SIDE), has one byte per cell of the tables and no other marks.
    """
    rows, cols = layer.shape[0] >> SIDE_BITS, layer.shape[1] >> SIDE_BITS
    listed = np.zeros((rows, cols), dtype=np.bool_)
    patches, n = np.empty((min(crossed.shape[0], rows * cols), 2), dtype=np.int32), 0
    last_row = last_col = -1
    for i in range(crossed.shape[0]):
        row, col = crossed[i, 0] >> SIDE_BITS, crossed[i, 1] >> SIDE_BITS
        if row == last_row and col == last_col:
            continue
        last_row, last_col = row, col
        if not listed[row, col]:
            listed[row, col] = True
            patches[n, 0], patches[n, 1] = row, col
            n += 1
    words, layer_words = np.empty((n, SIDE * WIDTH), dtype=np.uint64), layer.view(np.uint64)
    for i in range(n):
        for r in range(SIDE):
            for w in range(WIDTH):
                words[i, r * WIDTH + w] = layer_words[patches[i, 0] * SIDE + r, patches[i, 1] * WIDTH + w]
    return FreeSpaceMask(patches[:n], words)


@kernel
def clear(patches: IndexArray, layer: ByteArray) -> None:
    """Zero the layer in these patches."""
    words = layer.view(np.uint64)
    for i in range(patches.shape[0]):
        for r in range(patches[i, 0] * SIDE, patches[i, 0] * SIDE + SIDE):
            for w in range(patches[i, 1] * WIDTH, patches[i, 1] * WIDTH + WIDTH):
                words[r, w] = 0


@kernel
def hit_and_crossed(crossed: np.uint64, hits: np.uint64) -> np.uint64:
    """Return, for eight cells, a one in the byte of those that were crossed and have ever been hit."""
    return crossed & ((((hits & LOW) + LOW) | hits) >> TOP) & ONE


@kernel
def count_misses(crossed: WordArray, hits: WordArray, misses: WordArray) -> bool:
    """Add one to the misses of the cells that were crossed and never hit; halve a count of `COUNT_MAX` first.

    All arrays are of one patch, shape (SIDE * SIDE / 8,). Returns whether a crossed cell had been hit before:
    such a cell may change its state, and is left to the caller. There are no branches, so the compiler
    vectorizes the loop.
    """
    left = np.uint64(0)
    for i in range(crossed.size):
        rest = hit_and_crossed(crossed[i], hits[i])
        left |= rest
        more, count = crossed[i] ^ rest, misses[i]
        full = more & ((((count & LOW) + TO_CARRY) & count) >> TOP)
        full = (full << BYTE) - full  # all bits of its byte
        misses[i] = ((count & ~full) | ((count >> HALF) & LOW & full)) + more
    return bool(left)


@kernel
def neighbours(patches: IndexArray, cells: IndexArray, rows: int, cols: int) -> IndexArray:
    """Return the given patches, the patches of `cells`, and the eight around each, shape (n, 2).

    `patches` and `cells` are (row, column) each; the tables have `rows` rows and `cols` columns.
    """
    listed = np.zeros((rows, cols), dtype=np.bool_)
    found, n = np.empty((rows * cols, 2), dtype=np.int32), 0
    last_row = last_col = -1
    for i in range(patches.shape[0] + cells.shape[0]):
        if i < patches.shape[0]:
            row, col = int(patches[i, 0]), int(patches[i, 1])
        else:
            cell = cells[i - patches.shape[0]]
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
