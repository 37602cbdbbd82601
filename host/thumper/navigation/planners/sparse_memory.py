"""Memory for searches in large maps: taken where a search comes by, and returned with the array."""

import mmap
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", np.uint8, np.int32, np.float32, np.float64)

LARGE_BYTES = 4_000_000  # from here on numpy asks for huge pages


def sparse_zeros(count: int, dtype: type[Number]) -> NDArray[Number]:
    """Return zeros, shape (count,), that take no memory until they are written.

    A huge page holds 2 MB, which the system clears at the first touch: 30 rows of a large map, of which a
    search near the robot uses a few cells each. So this memory comes in small pages.
    """
    size = count * np.dtype(dtype).itemsize
    if size < LARGE_BYTES or not hasattr(mmap, "MADV_NOHUGEPAGE"):
        return np.zeros(count, dtype)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    with suppress(OSError):  # a kernel without huge pages
        memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.ndarray(count, dtype, buffer=memory)
