"""Ctrl-C for certain. Python raises KeyboardInterrupt wherever the program happens to be; where that is a
callback from a library's C code (numba's, each time a kernel returns an array) the exception is lost.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_came = [False]  # no Event: a handler must not wait for a lock that the code it interrupts may hold


@contextmanager
def record_interrupts() -> Iterator[None]:
    """Note, for `raise_lost_interrupt`, each signal that raises KeyboardInterrupt.

    In another thread than the main one, to which no signal comes, it does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours = [number for number in _SIGNALS if signal.getsignal(number) is signal.default_int_handler]
    for number in ours:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.default_int_handler)


@contextmanager
def raise_lost_interrupt() -> Iterator[None]:
    """Raise KeyboardInterrupt at the end if one came and was lost on the way: for one turn of a loop."""
    _came[0] = False
    try:
        yield
    finally:
        if _came[0]:
            raise KeyboardInterrupt


def _interrupt(number: int, frame: FrameType | None) -> None:
    _came[0] = True
    signal.default_int_handler(number, frame)
