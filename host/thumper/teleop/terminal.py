"""Single keys from the terminal, without waiting for Enter and without waiting at all."""

import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

MOST_BYTES = 1024


class Terminal:
    """What was typed since the last look."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    def read(self) -> bytes:
        """Return it; nothing when nothing was typed."""
        ready, _, _ = select.select([self._handle], [], [], 0.0)
        return os.read(self._handle, MOST_BYTES) if ready else b""


@contextmanager
def raw_terminal() -> Iterator[Terminal | None]:
    """Give the terminal, key by key, as long as it lasts; None when standard input is none."""
    if not sys.stdin.isatty():
        yield None
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    try:
        tty.setcbreak(handle)
        yield Terminal(handle)
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)
