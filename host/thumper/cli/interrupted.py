"""Ctrl-C outside a drive: while a command that moves the robot loads, waits for a device or writes files."""

from collections.abc import Iterator
from contextlib import contextmanager

from thumper.errors import EXIT_INTERRUPTED, ThumperError


@contextmanager
def motors_off_told() -> Iterator[None]:
    """Say in one line that nothing moves; a drive itself minds Ctrl-C before this does."""
    try:
        yield
    except KeyboardInterrupt:
        raise ThumperError("interrupted; the motors are off", exit_code=EXIT_INTERRUPTED) from None
