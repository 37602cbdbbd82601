"""Show that kernels are compiled: it takes minutes where those of the package do not fit."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Protocol

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner

COMPILING = "compiling for this computer, once: 1 to 2 minutes"
FIRST_START = 295  # kernels that the default options need, if none is there yet
COUNTED_KERNELS = 50  # without a terminal, one line for as many


class KernelCounter(Protocol):
    """How many kernels were compiled, in this process or in several; one within another counts, too."""

    value: int


@contextmanager
def compile_progress(
    console: Console,
    loading: str = "",
    *,
    expected: int = FIRST_START,
    counter: KernelCounter | None = None,
) -> Iterator[KernelCounter]:
    """Count the kernels that are compiled inside the block, in one line that ends as a summary.

    The line compares them with those that are `expected` at most. Without a terminal, there is a line for
    every `COUNTED_KERNELS`.

    If all are loaded from disk, a terminal shows `loading` meanwhile, and nothing remains.
    """
    from numba.core import event

    counted = counter or SimpleNamespace(value=0)
    started, next_line = False, COUNTED_KERNELS
    spinner = Spinner("dots", loading)
    # numba's colours and rich would both replace stdout.
    line = Live(spinner, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
    if loading:
        line.start()

    class Listener(event.Listener):
        def on_start(self, event: event.Event) -> None:
            nonlocal started
            if not started:
                started = True
                spinner.update(text=COMPILING)
                line.start()
                if not console.is_terminal:
                    console.print(COMPILING)

        def on_end(self, event: event.Event) -> None:
            nonlocal next_line
            counted.value += 1
            if not console.is_terminal and counted.value >= next_line:
                next_line = counted.value + COUNTED_KERNELS
                console.print(_text(counted.value, expected), highlight=False)
            spinner.update(text=f"{COMPILING}; {_text(counted.value, expected)}")

    listener = Listener()
    event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
    try:
        yield counted
    finally:
        event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]
        line.stop()
    if counted.value:
        console.print(f"compiled {counted.value} kernels")


def _text(count: int, expected: int) -> str:
    return f"{count} of about {expected} kernels" if count <= expected else f"{count} kernels"
