"""Handle Ctrl-C outside a drive: while a command loads, waits for a device, maps or writes files."""

from collections.abc import Iterator
from contextlib import contextmanager

from thumper.common.errors import EXIT_INTERRUPTED, ThumperError


@contextmanager
def report_interrupt(default: str = "") -> Iterator[None]:
    """Turn Ctrl-C into a one-line `ThumperError`.

    It repeats what an opened robot reported about its motors, or else `default`.
    """
    try:
        yield
    except KeyboardInterrupt as interrupt:
        detail = str(interrupt) or default
        raise ThumperError(
            f"interrupted; {detail}" if detail else "interrupted", exit_code=EXIT_INTERRUPTED
        ) from None
