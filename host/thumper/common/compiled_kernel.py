"""How kernels are compiled: by numba, cached on disk, single-threaded. Imported at the first call of one."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.core.caching import (
    CacheImpl,
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
)

from thumper.common.kernel_files import choose_processor, kernel_folder, source_hash
from thumper.common.kernel_library import KernelLibrary
from thumper.common.numba_kernel import SHIP_VARIABLE

choose_processor()

# Numba loads scipy.linalg to find out whether it exists: 16 MB and 0.1 s, for matrix products that no kernel
# uses. Hide the module while numba looks.
if "scipy.linalg" not in sys.modules:
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules["scipy.linalg"]

from numba.extending import overload  # noqa: E402 - after the lines that hide scipy.linalg

P = ParamSpec("P")
R = TypeVar("R")


class ReadOnlyLocator(_CacheLocator):
    """Where neither the package nor the user's cache can be written: kernels are read, but none is kept."""

    def __init__(self, line: int) -> None:
        self._line = line

    def get_cache_path(self) -> str:
        """Return a folder that does not exist."""
        return str(Path(__file__).with_name("no-folder"))

    def ensure_cache_path(self) -> None:
        """Refuse to make it."""
        raise OSError("no folder for compiled kernels can be written")

    def get_source_stamp(self) -> str:
        """Return nothing: `KernelCache` has its own stamps."""
        return ""

    def get_disambiguator(self) -> str:
        """Return the first line, as numba's locators do."""
        return str(self._line)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "ReadOnlyLocator":
        """Return a locator for any function."""
        del py_file
        return cls(py_func.__code__.co_firstlineno)


class KernelFiles(CompileResultCacheImpl):
    """Numba's files, also where nothing can be written."""

    _locator_classes: Any = [*CacheImpl._locator_classes, ReadOnlyLocator]  # noqa: RUF012


class KernelCache(FunctionCache):
    """Compiled kernels on disk: those of the package, which are only read, then those of the user.

    A kernel whose files cannot be read is compiled again: they name the classes of its arguments, and an
    upgrade may rename them.
    """

    _impl_class = KernelFiles

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        folder = kernel_folder(function.__module__)
        user = self._file(self._cache_path)
        shipped = user if folder is None else self._file(str(folder))
        self._is_shipping = SHIP_VARIABLE in os.environ
        self._written = shipped if self._is_shipping else user
        self._read = (shipped,) if self._is_shipping else (shipped, user)

    def _file(self, folder: str) -> IndexDataCacheFile:
        stamp = source_hash(self._py_func.__module__) + source_hash(__name__)
        return IndexDataCacheFile(folder, self._impl.filename_base, stamp)  # type: ignore[no-untyped-call]

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for these types; None: compile it."""
        _prepare(target_context)
        for file in self._read:
            self._cache_file = file
            try:
                found = self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
            except Exception:  # an old or damaged pickle can raise anything
                found = None
                if file is self._written:
                    with suppress(OSError):
                        self.flush()  # type: ignore[no-untyped-call]  # writes an empty index
            if found is not None:
                return found
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the compiled function, if there is room."""
        self._cache_file = self._written
        with suppress(OSError), self._only_writer():
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]

    @contextmanager
    def _only_writer(self) -> Iterator[None]:
        """Wait for other processes that ship kernels: each writes an index of all that it knows."""
        if not self._is_shipping:
            yield
            return
        import fcntl  # kernels are shipped on Linux only

        folder = Path(self._cache_file._cache_path)
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)


@cache
def _prepare(target_context: Any) -> None:
    """Let numba load its own parts: once, not for each kernel. Its compiler looks again for new ones."""
    target_context.refresh()
    target_context.codegen()._library_class = KernelLibrary


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Return numba's dispatcher of a function; the function itself if the compiler is disabled."""
    dispatcher: Any = numba.njit(nogil=True)(function)
    if dispatcher is not function:
        dispatcher._cache = KernelCache(function)
    return cast("Callable[P, R]", dispatcher)


def add_member(generic: Callable[..., Any], kind: type, function: Callable[..., Any]) -> None:
    """Compile a call of `generic` as one of `function` if its first argument is a `kind`."""

    def choose(first: object, *others: object) -> Callable[..., Any] | None:
        del others
        return function if getattr(first, "instance_class", None) is kind else None

    choose.__signature__ = signature(function)  # type: ignore[attr-defined]  # the compiler compares it
    overload(generic)(choose)
