"""One typed decorator for the hot loops: numba, cached on disk, single-threaded."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` to machine code at its first call; later processes load it from the cache."""
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True)(function))
