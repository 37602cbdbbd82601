"""Single keys from a terminal, without echo. No slow import: it must be ready before the first key."""

import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

MAX_READ_BYTES = 1024


class Terminal:
    """Non-blocking reads from a terminal."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    def read(self) -> bytes:
        """Return what was typed since the last call."""
        ready, _, _ = select.select([self._handle], [], [], 0.0)
        return os.read(self._handle, MAX_READ_BYTES) if ready else b""

    def drop(self) -> None:
        """Drop what was typed since the last call."""
        termios.tcflush(self._handle, termios.TCIFLUSH)


@contextmanager
def raw_terminal() -> Iterator[Terminal | None]:
    """Switch the terminal to single keys and back; yield None if standard input is not a terminal."""
    if not sys.stdin.isatty():
        yield None
        return
    handle = sys.stdin.fileno()
    saved = termios.tcgetattr(handle)
    try:
        tty.setcbreak(handle)
        yield Terminal(handle)
    finally:
        termios.tcsetattr(handle, termios.TCSAFLUSH, saved)  # the shell must not get a key meant to drive
