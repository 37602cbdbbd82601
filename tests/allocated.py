"""How much memory this process has allocated: that of Python and of libraries in C, C++ and Rust."""

import ctypes
import gc
from collections.abc import Callable
from itertools import pairwise
from statistics import median

import pytest


class _MallocInfo(ctypes.Structure):
    """`struct mallinfo2` of glibc."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )

    hblkhd: int
    uordblks: int


def kept_bytes(repeated: Callable[[], object], *, warm_up: int, repeats: int) -> float:
    """Return how many bytes stay allocated per repetition; skip the test without glibc 2.33.

    The median: threads of a library allocate and free in their own time, and tables double.
    """
    try:
        mallinfo = ctypes.CDLL(None).mallinfo2
    except AttributeError:
        pytest.skip("needs mallinfo2 of glibc")
    mallinfo.restype = _MallocInfo

    def allocated() -> int:
        gc.collect()
        info = mallinfo()
        return int(info.uordblks) + int(info.hblkhd)

    for _ in range(warm_up):
        repeated()
    totals = [allocated()]
    for _ in range(repeats):
        repeated()
        totals.append(allocated())
    return median(after - before for before, after in pairwise(totals))
