"""Make sure that Ctrl-C is never lost.

Python raises KeyboardInterrupt wherever the program happens to be. If that is a callback from the C code of a
library (numba makes one each time a kernel returns an array), the exception is lost.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))
"""Ctrl-C, `kill`, and the end of the terminal or ssh session: each stops the motors first."""

Handler = Callable[[int, FrameType | None], object]

_received = [False]  # not an Event: a handler must not wait for a lock that the interrupted code may hold


def forget_interrupts() -> None:
    """Forget the signals so far: call where a KeyboardInterrupt was caught."""
    _received[0] = False


@contextmanager
def record_interrupts() -> Iterator[None]:
    """Record each signal that raises KeyboardInterrupt, for `raise_lost_interrupt`.

    Does nothing outside the main thread.
    """
    if _in_main_thread():
        forget_interrupts()
    with _handled_by(_interrupt, instead_of=(signal.default_int_handler,)):
        yield


@contextmanager
def raise_lost_interrupt() -> Iterator[None]:
    """Raise KeyboardInterrupt at the end if one was lost, inside or before. Wrap one pass of a loop in it."""
    try:
        yield
    finally:
        if _received[0]:
            forget_interrupts()
            raise KeyboardInterrupt


@contextmanager
def hold_interrupt() -> Iterator[list[int]]:
    """Hold the first Ctrl-C back until the block has ended; a second one raises KeyboardInterrupt at once.

    Yields the signals held so far. Holds nothing outside the main thread.
    """
    held: list[int] = []

    def hold(number: int, frame: FrameType | None) -> None:
        if held:
            _interrupt(number, frame)
        held.append(number)

    with _handled_by(hold, instead_of=(_interrupt, signal.default_int_handler)):
        yield held


@contextmanager
def _handled_by(handler: Handler, *, instead_of: tuple[Handler, ...]) -> Iterator[None]:
    """Replace these handlers of the stop signals; only in the main thread, which alone receives signals."""
    if not _in_main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    ours = [number for number, one in before.items() if one in instead_of]
    for number in ours:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _interrupt(number: int, frame: FrameType | None) -> None:
    _received[0] = True
    signal.default_int_handler(number, frame)
