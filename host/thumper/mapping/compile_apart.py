"""Compiling the mapper's kernels in a process of its own, so that the compiler's 90 MB go when it ends."""

import subprocess
import sys
from pathlib import Path

from thumper.mapping.correlative import correlative_search
from thumper.mapping.method import Method
from thumper.mapping.particle_match import match_all
from thumper.mapping.wide_search import block_maximum

LAST_KERNELS = {"scan_match": correlative_search, "graph": block_maximum, "rbpf": match_all}
PROGRAM = (
    "import sys; from thumper.mapping.method import MappingOptions, make_mapper; "
    "make_mapper(MappingOptions(method=sys.argv[1])).warm_up()"
)


def compile_apart(method: Method) -> None:
    """Fill the cache on disk if this machine has never run the method; a failure is left to the warm-up."""
    kernel = LAST_KERNELS[method]
    cache = getattr(kernel, "_cache", None)  # numba offers no other way to ask
    folder = Path(getattr(cache, "cache_path", None) or ".")
    if not any(folder.glob(f"*.{kernel.__name__}-*.nbi")):
        subprocess.run([sys.executable, "-c", PROGRAM, method], check=False, capture_output=True)
