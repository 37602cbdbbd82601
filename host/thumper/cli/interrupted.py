"""Ctrl-C outside a drive: while a command loads, waits for a device, maps or writes files."""

from collections.abc import Iterator
from contextlib import contextmanager

from thumper.common.errors import EXIT_INTERRUPTED, ThumperError


@contextmanager
def interrupt_told(otherwise: str = "") -> Iterator[None]:
    """Say in one line what Ctrl-C has left: a robot that was opened says so itself, `otherwise` this."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        left = str(interrupt) or otherwise
        told = f"interrupted; {left}" if left else "interrupted"
        raise ThumperError(told, exit_code=EXIT_INTERRUPTED) from None
