"""Measure what a mapper's kernels cost before the first scan: compiled, and loaded from the cache.

Run: python benchmarks/warm_up.py [--method slam|scan_match|rbpf ...]

The figures are the CPU time and the peak memory of a process. `thumper map-log` compiles in subprocesses, one
after the other, and their start-up time counts. A robot compiles in its own process; there only the warm-up
counts.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import llvmlite.binding as llvm
from benchmarks.figure import figure

# The package's kernels are for another processor, by name, so that these runs compile.
COMPILING = {"NUMBA_CPU_NAME": llvm.get_host_cpu_name()}
METHODS = ("slam", "scan_match", "rbpf")

APART = """
import resource, sys
from thumper.offline.subprocesses import compile_in_subprocess
compile_in_subprocess(sys.argv[1])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
"""
WARM_UP = """
import resource, sys, time
from thumper.slam.factory import MappingOptions, make_mapper
mapper = make_mapper(MappingOptions(method=sys.argv[1]))
start_s = time.process_time()
mapper.warm_up()
print(time.process_time() - start_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""
FIRST_MOTION = """
import resource, sys, time
from thumper.config.robot import RobotConfig
from thumper.runtime.assembly import warm_up
warm_up(RobotConfig())
print(time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def cost(program: str, method: str, cache: str, **environment: str) -> tuple[float, float]:
    """Return the CPU time [s] and the peak memory [MB] that the program prints."""
    done = subprocess.run(
        [sys.executable, "-c", program, method],
        env=os.environ | {"NUMBA_CACHE_DIR": cache} | environment,
        check=True,
        capture_output=True,
        text=True,
    )
    cpu_s, peak_MB = (float(word) for word in done.stdout.split())
    return cpu_s, peak_MB


def main() -> None:
    """Measure each method with its own empty cache."""
    parser = argparse.ArgumentParser(description="cost of the kernels before the first scan")
    parser.add_argument("--method", nargs="+", default=METHODS, choices=METHODS)
    methods = parser.parse_args().method
    with tempfile.TemporaryDirectory() as cache:
        first_s, first_MB = min(cost(FIRST_MOTION, "", cache) for _ in range(3))
        compiled = sum(1 for _ in Path(cache).rglob("*.nbc"))
    what = f"first motion of a new user: imports and warm-up, {compiled} kernels compiled"
    figure(f"{what}: CPU", f"{first_s:.1f}", "s", aim="<= 4")
    figure(f"{what}: peak memory", f"{first_MB:.0f}", "MB", aim="<= 190")
    for method in methods:
        with tempfile.TemporaryDirectory() as cache:
            alone_s, alone_MB = cost(WARM_UP, method, cache, **COMPILING)
        with tempfile.TemporaryDirectory() as cache:
            apart_s, largest_MB = cost(APART, method, cache, **COMPILING)
            again_s, again_MB = min(cost(WARM_UP, method, cache, **COMPILING) for _ in range(3))
        for what, cpu_s, peak_MB in (
            ("compiled in one process", alone_s, alone_MB),
            ("compiled as map-log does", apart_s, largest_MB),
            ("warm-up from the cache", again_s, again_MB),
        ):
            figure(f"{method}: {what}: CPU", f"{cpu_s:.1f}", "s")
            figure(f"{method}: {what}: peak memory", f"{peak_MB:.0f}", "MB")


if __name__ == "__main__":
    main()
