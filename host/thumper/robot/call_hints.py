"""Errors of the calls of `Robot`: short tracebacks, and for arguments that do not exist how it is called."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from thumper.common.errors import EXIT_USAGE, ThumperError

P = ParamSpec("P")
ResultT = TypeVar("ResultT")
KindT = TypeVar("KindT")


def with_call_hints(kind: type[KindT]) -> type[KindT]:
    """Return a class whose public methods, and which itself, raise ThumperError when called wrongly."""
    for name, method in list(vars(kind).items()):
        if inspect.isfunction(method) and (name == "__init__" or not name.startswith("_")):
            setattr(kind, name, _checked(method, kind.__name__ if name == "__init__" else name))
    return kind


def _checked(method: Callable[P, ResultT], name: str) -> Callable[P, ResultT]:
    signature = inspect.signature(method)

    @wraps(method)
    def call(*args: P.args, **kwargs: P.kwargs) -> ResultT:
        try:
            signature.bind(*args, **kwargs)
        except TypeError as error:
            raise ThumperError(f"{name}: {error}; call {name}{_usage()}", exit_code=EXIT_USAGE) from None
        try:
            return method(*args, **kwargs)
        except ThumperError as error:  # its line says all: no causes, no frames of this package
            raise error.with_traceback(None) from None

    # A VAR_POSITIONAL is there to be refused.
    taken = [one for one in signature.parameters.values() if one.kind is not one.VAR_POSITIONAL]
    call.__signature__ = signature.replace(parameters=taken)  # type: ignore[attr-defined]

    def _usage() -> str:
        """Return the arguments without types."""
        return str(inspect.Signature([one.replace(annotation=one.empty) for one in taken[1:]]))

    return call
