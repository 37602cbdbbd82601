"""A binary min-heap in two arrays, keys and items, for the search kernels. The caller keeps the size."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.inflation import IntArray

Number = TypeVar("Number", np.float64, np.int32)


@kernel
def heap_push(keys: FloatArray, items: IntArray, size: int, key: float, item: int) -> None:
    """Add an entry to a heap of `size` entries; the arrays must have room for it."""
    slot = size
    while slot > 0:
        parent = (slot - 1) >> 1
        if keys[parent] <= key:
            break
        keys[slot] = keys[parent]
        items[slot] = items[parent]
        slot = parent
    keys[slot] = key
    items[slot] = item


@kernel
def heap_pop(keys: FloatArray, items: IntArray, size: int) -> int:
    """Remove the entry with the smallest key and return its item; `size - 1` entries remain."""
    first = int(items[0])
    last = size - 1
    key, item = keys[last], items[last]
    slot = 0
    while True:
        child = 2 * slot + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[slot] = keys[child]
        items[slot] = items[child]
        slot = child
    keys[slot] = key
    items[slot] = item
    return first


@kernel
def doubled(array: NDArray[Number]) -> NDArray[Number]:
    """Return a copy of twice the length; the second half is not initialised."""
    larger = np.empty(2 * array.size, array.dtype)
    larger[: array.size] = array
    return larger
