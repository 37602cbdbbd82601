"""Show that kernels are compiled: it takes minutes where those of the package do not fit."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console


class CompileProgress:
    """How many kernels were compiled; one within another counts, too."""

    started = False
    count = 0


@contextmanager
def compile_progress(console: Console) -> Iterator[CompileProgress]:
    """Show how many kernels are compiled inside the block; nothing if all are loaded from disk."""
    from numba.core import event

    progress = CompileProgress()

    class Listener(event.Listener):
        def on_start(self, event: event.Event) -> None:
            if not progress.started:
                progress.started = True
                console.print("compiling for this computer, once: a few minutes")

        def on_end(self, event: event.Event) -> None:
            progress.count += 1
            if progress.count % 10 == 0:
                console.print(f"compiled {progress.count} kernels")

    listener = Listener()
    event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
    try:
        yield progress
    finally:
        event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]
