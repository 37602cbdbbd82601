"""The decorator of all compiled kernels. Importing numba takes 0.5 s, so it waits for the first call."""

from collections.abc import Callable
from functools import update_wrapper
from threading import RLock
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

SHIP_VARIABLE = "THUMPER_SHIP_KERNELS"
"""If this environment variable is set, kernels are written to their package instead of the user's cache."""

_members: list[tuple[Callable[..., Any], type, Callable[..., Any]]] = []  # that numba does not know yet
_lock = RLock()


class Kernel(Generic[P, R]):
    """A function that is compiled at its first call. Kernels can call it as they call each other."""

    def __init__(self, function: Callable[P, R]) -> None:
        self._function = function
        self._compiled: Callable[P, R] | None = None
        update_wrapper(self, function)

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """Run the machine code."""
        return (self._compiled or self.compiled)(*arguments, **named)

    @property
    def compiled(self) -> Any:
        """Numba's dispatcher of the function; the function itself if the compiler is disabled."""
        with _lock:
            if self._compiled is None:
                from thumper.common import compiled_kernel

                while _members:
                    compiled_kernel.add_member(*_members.pop(0))
                self._compiled = compiled_kernel.compiled(self._function)
        return self._compiled

    @property
    def _numba_type_(self) -> Any:
        """What numba takes this object for where a kernel refers to it."""
        return self.compiled._numba_type_


def kernel(function: Callable[P, R]) -> Kernel[P, R]:
    """Compile `function` to machine code at its first call. Later processes load it from disk."""
    return Kernel(function)


def member(generic: Callable[..., R], kind: type) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a plain function the one that kernels run for `generic` if its first argument is a `kind`.

    `kind` is a named tuple. The compiler chooses, so the choice costs nothing when the kernel runs.
    """

    def add(function: Callable[P, R]) -> Callable[P, R]:
        _members.append((generic, kind, function))
        return function

    return add
