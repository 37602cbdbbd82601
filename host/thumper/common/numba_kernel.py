"""One typed decorator for the hot loops: numba, cached on disk, single-threaded."""

import sys
from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

# Numba's array functions look whether scipy.linalg is there by loading it: 16 MB and 0.1 s for products of
# matrices that no kernel makes. So it is not there for this moment.
if "scipy.linalg" not in sys.modules:
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    try:
        import numba.np.arraymath
    finally:
        del sys.modules["scipy.linalg"]

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` to machine code at its first call; later processes load it from the cache."""
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True)(function))
