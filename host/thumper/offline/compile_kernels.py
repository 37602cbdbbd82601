"""Fill the disk cache with a mapper's kernels: `python -m thumper.offline.compile_kernels METHOD`.

The compiler never frees memory. Above `MEMORY_LIMIT_MB` the process exits with `INCOMPLETE` before it
compiles another kernel. Start it again, and it continues with the first kernel that is not in the cache.
"""

import os
import resource
import sys
from pathlib import Path

from thumper.slam.factory import MappingOptions, Method, make_mapper

INCOMPLETE = 3  # exit status: some kernels are not compiled yet
MEMORY_LIMIT_MB = 210  # one more kernel takes up to 20


def memory_MB() -> float:
    """Return the resident memory of this process [MB]; 0 if the system does not report it."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * resource.getpagesize() / 2**20 if statm.exists() else 0.0


def compile_kernels(method: Method) -> None:
    """Call every kernel of the method once."""
    from numba.core import event

    class MemoryLimit(event.Listener):
        """Ends the process at the memory limit, but only after it has compiled a kernel."""

        compiled = 0

        def on_start(self, _event: event.Event) -> None:
            if self.compiled and memory_MB() > MEMORY_LIMIT_MB:
                os._exit(INCOMPLETE)

        def on_end(self, _event: event.Event) -> None:
            self.compiled += 1

    event.register("numba:compile", MemoryLimit())  # type: ignore[no-untyped-call]
    make_mapper(MappingOptions(method=method)).warm_up()


if __name__ == "__main__":
    compile_kernels(sys.argv[1])  # type: ignore[arg-type]  # `subprocesses` passes a method
