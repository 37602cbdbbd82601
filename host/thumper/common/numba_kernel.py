"""The decorator of all compiled kernels: numba, cached on disk, single-threaded."""

import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from inspect import signature
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.core.caching import FunctionCache

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


class KernelCache(FunctionCache):
    """Numba's cache on disk. A kernel whose files cannot be read is compiled again.

    The files name the classes of the kernel's arguments, and numba reads these names before it looks whether
    the source changed. Without this class, an upgrade that renames such a class ends in an AttributeError.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for these types; None: compile it."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # an old or damaged pickle can raise anything
            self.flush()  # type: ignore[no-untyped-call]  # writes an empty index
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the compiled function, if there is room."""
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` to machine code at its first call. Later processes load it from the cache."""
    compiled: Any = numba.njit(cache=True, nogil=True)(function)
    if compiled is not function:  # the compiler is not disabled
        compiled._cache = KernelCache(function)  # type: ignore[no-untyped-call]
    return cast("Callable[P, R]", compiled)


def member(generic: Callable[..., R], kind: type) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a plain function the one that kernels run for `generic` if its first argument is a `kind`.

    `kind` is a named tuple. The compiler chooses, so the choice costs nothing when the kernel runs.
    """

    from numba.extending import overload  # after the lines above that hide scipy.linalg

    def add(function: Callable[P, R]) -> Callable[P, R]:
        def choose(first: object, *others: object) -> Callable[P, R] | None:
            del others
            return function if getattr(first, "instance_class", None) is kind else None

        choose.__signature__ = signature(function)  # type: ignore[attr-defined]  # the compiler compares it
        overload(generic)(choose)
        return function

    return add
