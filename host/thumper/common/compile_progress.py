"""Show that kernels are compiled: it takes minutes where those of the package do not fit."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner

COMPILING = "compiling for this computer, once: 1 to 2 minutes"
COUNTED_KERNELS = 50  # without a terminal, one line for as many


class CompileProgress:
    """How many kernels were compiled; one within another counts, too."""

    started = False
    count = 0


@contextmanager
def compile_progress(console: Console, loading: str = "") -> Iterator[CompileProgress]:
    """Count the kernels that are compiled inside the block, in one line that ends as a summary.

    Without a terminal, there is a line for every `COUNTED_KERNELS`.

    If all are loaded from disk, a terminal shows `loading` meanwhile, and nothing remains.
    """
    from numba.core import event

    progress = CompileProgress()
    spinner = Spinner("dots", loading)
    # numba's colours and rich would both replace stdout.
    line = Live(spinner, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
    if loading:
        line.start()

    class Listener(event.Listener):
        def on_start(self, event: event.Event) -> None:
            if not progress.started:
                progress.started = True
                spinner.update(text=COMPILING)
                line.start()
                if not console.is_terminal:
                    console.print(COMPILING)

        def on_end(self, event: event.Event) -> None:
            progress.count += 1
            if not console.is_terminal and progress.count % COUNTED_KERNELS == 0:
                console.print(f"{progress.count} kernels so far", highlight=False)
            spinner.update(text=f"{COMPILING}; {progress.count} kernels so far")

    listener = Listener()
    event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
    try:
        yield progress
    finally:
        event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]
        line.stop()
    if progress.count:
        console.print(f"compiled {progress.count} kernels")
