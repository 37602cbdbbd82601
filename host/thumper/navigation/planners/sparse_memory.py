"""Memory for searches in large maps: taken where a search comes by, and used again by the next search.

The system clears each page at its first touch. That took as long as a search near the robot itself, because
each row of a large map has its own pages. So the memory is kept, and only the cells that the last search has
reached are cleared.
"""

import mmap
import weakref
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel

Number = TypeVar("Number", np.uint8, np.int32, np.float32, np.float64)
Reached = NDArray[np.int64]
"""Lowest row and column and highest row and column of the cells that a search has reached, shape (4,)."""

LARGE_BYTES = 4_000_000  # from here on numpy asks for huge pages
KEPT = 8  # pieces of memory: those of two searches
MOST_KEPT_BYTES = 8_000_000  # that searches have written in one of them


def reached_from(row: int, col: int) -> Reached:
    """Return the box round the cell where a search starts; its kernel grows it."""
    return np.array((row, col, row, col))


@kernel
def extend(reached: Reached, row: int, col: int) -> None:
    """Extend the box of cells that a search has reached."""
    reached[0], reached[1] = min(reached[0], row), min(reached[1], col)
    reached[2], reached[3] = max(reached[2], row), max(reached[3], col)


class _Memory:
    """Zeros for an array of (rows, columns)."""

    def __init__(self, size: int) -> None:
        self.size, self.written = size, 0
        self.content = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        with suppress(OSError):  # a kernel without huge pages
            # A huge page holds 2 MB: 30 rows of a large map, of which a search uses a few cells each.
            self.content.madvise(mmap.MADV_NOHUGEPAGE)


_free: list[_Memory] = []  # all zero


def sparse_zeros(rows: int, cols: int, dtype: type[Number], reached: Reached) -> NDArray[Number]:
    """Return zeros, shape (rows * cols,), that take no memory until they are written.

    The search may write cells in the box `reached` and next to it. They are cleared when nobody holds the
    array any more.
    """
    size = rows * cols * np.dtype(dtype).itemsize
    if size < LARGE_BYTES or not hasattr(mmap, "MADV_NOHUGEPAGE"):
        return np.zeros(rows * cols, dtype)
    memory = _take(size)
    array = np.ndarray(rows * cols, dtype, buffer=memory.content)
    give_back = weakref.finalize(array, _give_back, memory, (rows, cols), np.dtype(dtype), reached)
    give_back.atexit = False
    return array


def _take(size: int) -> _Memory:
    for memory in tuple(_free):
        if memory.size == size:
            with suppress(ValueError):  # another thread has taken it
                _free.remove(memory)
                return memory
    return _Memory(size)


def _give_back(memory: _Memory, shape: tuple[int, int], dtype: np.dtype[Number], reached: Reached) -> None:
    """Clear what a search has written and keep the memory, unless it has become large."""
    top, left, bottom, right = reached.tolist()
    rows, cols = slice(max(0, top - 1), bottom + 2), slice(max(0, left - 1), right + 2)
    written = np.ndarray(shape, dtype, buffer=memory.content)[rows, cols]
    memory.written += written.nbytes
    if memory.written > MOST_KEPT_BYTES:
        return
    written[:] = 0
    _free.append(memory)
    del _free[:-KEPT]  # the oldest, perhaps of a smaller map
