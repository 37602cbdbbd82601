"""The decorator of all compiled kernels: numba, cached on disk, single-threaded."""

import sys
from collections.abc import Callable
from importlib import import_module
from typing import ParamSpec, TypeVar, cast

import numba

# Numba loads scipy.linalg to find out whether it exists: 16 MB and 0.1 s, for matrix products that no kernel
# uses. Hide the module while numba looks.
if "scipy.linalg" not in sys.modules:
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules["scipy.linalg"]

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` to machine code at its first call. Later processes load it from the cache."""
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True)(function))
