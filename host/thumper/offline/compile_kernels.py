"""Fill the cache on disk with a mapper's kernels: `python -m thumper.offline.compile_kernels METHOD`.

The compiler gives no memory back: past `ENOUGH_MB` the process ends with `GO_ON` before it compiles another
kernel. Start it again, and it goes on with the first one that is not in the cache.
"""

import os
import resource
import sys
from pathlib import Path

from numba.core import event

from thumper.slam.factory import MappingOptions, Method, make_mapper

GO_ON = 3  # exit code: there are kernels left
ENOUGH_MB = 210  # one kernel more takes up to 20


class _Limit(event.Listener):
    """Ends the process in time, but not before it has compiled something."""

    def __init__(self) -> None:
        self._compiled = 0

    def on_start(self, _event: event.Event) -> None:
        if self._compiled and memory_MB() > ENOUGH_MB:
            os._exit(GO_ON)

    def on_end(self, _event: event.Event) -> None:
        self._compiled += 1


def memory_MB() -> float:
    """Resident memory of this process; 0 where the system does not say."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * resource.getpagesize() / 2**20 if statm.exists() else 0.0


def compile_kernels(method: Method) -> None:
    """Call every kernel of the method once."""
    event.register("numba:compile", _Limit())  # type: ignore[no-untyped-call]
    make_mapper(MappingOptions(method=method)).warm_up()


if __name__ == "__main__":
    compile_kernels(sys.argv[1])  # type: ignore[arg-type]  # `apart` passes a method
