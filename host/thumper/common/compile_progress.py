"""Show that kernels are compiled: it takes minutes where those of the package do not fit."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Protocol

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner

COMPILING = "compiling the mapping and planning code, once"
FIRST_START = 295  # kernels that the default options need, if none is there yet
LINE_PERIOD_S = 10.0  # between two lines without a terminal


class KernelCounter(Protocol):
    """How many kernels were compiled, in this process or in several; one within another counts, too."""

    value: int


class _Line:
    """Shows the share that is compiled: in a line of the terminal, else in one every `LINE_PERIOD_S`."""

    def __init__(self, console: Console, loading: str, expected: int, counter: KernelCounter) -> None:
        self._console, self._expected, self._counter = console, expected, counter
        self._begun_s = time.monotonic()
        self._started = False
        self._ended = threading.Event()
        self._spinner = Spinner("dots", loading)
        # numba's colours and rich would both replace stdout.
        self._live = Live(
            get_renderable=self._shown,
            console=console,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        if loading:
            self._live.start()
        if not console.is_terminal:
            threading.Thread(target=self._print_lines, name="compile-progress", daemon=True).start()

    def start(self) -> None:
        """Say that it compiles, at the first kernel."""
        if self._started:
            return
        self._started = True
        self._live.start()
        if not self._console.is_terminal:
            self._console.print(COMPILING)

    def end(self) -> None:
        """Remove the line."""
        self._ended.set()
        self._live.stop()

    def summarize(self) -> None:
        """Say how long it took, if any were compiled."""
        if self._counter.value:
            self._console.print(f"compiled in {self._elapsed_s:.0f} s")

    @property
    def _elapsed_s(self) -> float:
        return time.monotonic() - self._begun_s

    def _text(self) -> str:
        percent = min(99, 100 * self._counter.value // self._expected)
        return f"{percent} %, {self._elapsed_s:.0f} s"

    def _shown(self) -> Spinner:
        if self._started:
            self._spinner.update(text=f"{COMPILING}; {self._text()}")
        return self._spinner

    def _print_lines(self) -> None:
        while not self._ended.wait(LINE_PERIOD_S):
            if self._started or self._counter.value:  # or a second process compiles
                self._console.print(self._text(), highlight=False)


@contextmanager
def compile_progress(
    console: Console,
    loading: str = "",
    *,
    expected: int = FIRST_START,
    counter: KernelCounter | None = None,
) -> Iterator[KernelCounter]:
    """Count the kernels that are compiled inside the block, in one line that ends as a summary.

    The line has the elapsed time and the share of the kernels that are `expected` at most. Without a
    terminal, there is a line every `LINE_PERIOD_S`.

    If all are loaded from disk, a terminal shows `loading` meanwhile, and nothing remains.
    """
    from numba.core import event

    counted = counter or SimpleNamespace(value=0)
    line = _Line(console, loading, expected, counted)

    class Listener(event.Listener):
        def on_start(self, event: event.Event) -> None:
            line.start()

        def on_end(self, event: event.Event) -> None:
            counted.value += 1

    listener = Listener()
    event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
    try:
        yield counted
    finally:
        event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]
        line.end()
    line.summarize()
