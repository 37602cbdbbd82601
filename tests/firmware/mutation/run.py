"""Does the desk suite notice? Builds the core once per mutant and runs the tests that need no chip.

python -m tests.firmware.mutation.run                  all of them (`make mutation`)
python -m tests.firmware.mutation.run --sample 20      a random few, by --seed
python -m tests.firmware.mutation.run --only pi.hpp battery.hpp:35:    those whose printed place begins so
"""

import argparse
import os
import random
import re
import resource
import shutil
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.context import ForkProcess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.firmware import speaker  # noqa: F401  imported once, here, for every process to come
from tests.firmware.mutation.mutants import CORE, Mutant, mutants

TESTS = Path(__file__).resolve().parents[1]
SUITE = {
    "test_wheel": {"parameters.hpp"},
    "test_supervisor": {"supervisor.hpp"},
    "test_monitors": {"host_interface.hpp", "beep.hpp", "config.hpp"},
    "test_ramp_battery_units": {"parameters.hpp", "battery.hpp"},
    "test_host_interface": {"host_interface.hpp"},
    "test_store": {"host_interface.hpp"},
    "test_quadrature": {"quadrature.hpp", "drive.hpp"},
    "test_framing": {"framing.hpp"},
    "test_model": {"parameters.hpp"},
    "test_law": {"parameters.hpp"},
    "test_pi": {"pi.hpp"},
}
"""Which headers a test goes through; with what these include it is all that it can notice a change of. The
quick ones first: pytest stops at the first failure."""
OWN = {
    "battery.hpp": "test_ramp_battery_units",
    "beep.hpp": "test_monitors",
    "config.hpp": "test_law",
    "crc.hpp": "test_framing",
    "drive.hpp": "test_quadrature",
    "feedforward.hpp": "test_model",
    "fixed.hpp": "test_law",
    "framing.hpp": "test_framing",
    "host_interface.hpp": "test_host_interface",
    "monitor.hpp": "test_monitors",
    "parameters.hpp": "test_store",
    "pi.hpp": "test_pi",
    "quadrature.hpp": "test_quadrature",
    "ramp.hpp": "test_ramp_battery_units",
    "store.hpp": "test_store",
    "supervisor.hpp": "test_supervisor",
    "units.hpp": "test_ramp_battery_units",
    "wheel.hpp": "test_wheel",
}
"""The test likeliest to notice a change of a file; it goes before all others."""
INCLUDE = re.compile(r'#include "core/(.+)"')
LONG, HAVE_LONG = "million or long_drive", {"test_law", "test_pi"}
"""Which tests take seconds."""
TIMEOUT_S = 60
"""Of processor time: a mutant that runs for ever is noticed too."""
NOTICED, UNNOTICED = 1, 0

# Which example fails does not matter here, so none is made smaller; a busy machine is no failure.
settings.register_profile(
    "mutation",
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=list(HealthCheck),
)


@cache
def reached(header: str) -> frozenset[str]:
    """Return a header of the core and all that it includes."""
    included = INCLUDE.findall((CORE / header).read_text(encoding="utf-8"))
    return frozenset({header}).union(*map(reached, included))


def suite_for(file: str | None) -> Iterator[list[str]]:
    """Yield pytest's arguments for one run after the other: long tests come last."""
    able = [name for name, roots in SUITE.items() if not file or any(file in reached(root) for root in roots)]
    own = [name for name in able if name == OWN.get(file or "")]
    others = [name for name in able if name not in own]
    long = [name for name in able if name in HAVE_LONG]
    for names, which in ((own, f"not ({LONG})"), (others, f"not ({LONG})"), (long, LONG)):
        if names:
            yield [*(str(TESTS / f"{name}.py") for name in names), "-k", which]


def _test(folder: str, file: str | None, log: str) -> None:
    """In a process of its own: leave with NOTICED or UNNOTICED."""
    resource.setrlimit(resource.RLIMIT_CPU, (TIMEOUT_S, TIMEOUT_S))
    os.environ["THUMPER_MUTANT"] = folder
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # or each process imports a browser's
    options = ["-x", "-q", "--hypothesis-profile=mutation", "-p", "no:cacheprovider"]
    options += ["-p", "pytest_timeout", "-p", "_hypothesis_pytestplugin"]
    for arguments in suite_for(file):
        if pytest.main([*options, *arguments]) != pytest.ExitCode.OK:
            os._exit(NOTICED)
    os._exit(UNNOTICED)


def start(mutant: Mutant | None, scratch: Path) -> ForkProcess:
    """Begin to build and test a copy of the core with this one change, or with none."""
    shutil.copytree(CORE, scratch / "core")
    if mutant:
        path = scratch / "core" / mutant.file
        path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")
    arguments = (str(scratch), mutant.file if mutant else None, str(scratch / "log"))
    process = get_context("fork").Process(target=_test, args=arguments)  # pytest is imported once
    process.start()
    return process


def fails_unchanged() -> str:
    """Return what the suite says about the core as it is, if that is not good."""
    with tempfile.TemporaryDirectory() as scratch:
        process = start(None, Path(scratch))
        process.join()
        return "" if process.exitcode == UNNOTICED else (Path(scratch) / "log").read_text(encoding="utf-8")


def survivors(chosen: list[Mutant], jobs: int) -> Iterator[Mutant]:
    """Yield the mutants that no test noticed, as they are found."""
    waiting, running = list(reversed(chosen)), dict[int, tuple[ForkProcess, Mutant, Path]]()
    while waiting or running:
        while waiting and len(running) < jobs:
            scratch = Path(tempfile.mkdtemp())
            process = start(waiting[-1], scratch)
            running[process.sentinel] = process, waiting.pop(), scratch
        for sentinel in wait(list(running)):
            assert isinstance(sentinel, int)
            process, mutant, scratch = running.pop(sentinel)
            process.join()
            shutil.rmtree(scratch)
            if process.exitcode == UNNOTICED:
                yield mutant


def main() -> int:
    """Print the survivors and their share; fail below 90 % killed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sample", type=int, default=0, help="how many, 0 = all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""], help="only those whose printed place begins so")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    if said := fails_unchanged():
        print(said)
        print("the suite fails without any change: mend that first")
        return 2
    chosen = [mutant for mutant in mutants() if str(mutant).startswith(tuple(arguments.only))]
    if arguments.sample:
        chosen = random.Random(arguments.seed).sample(chosen, arguments.sample)
    alive = 0
    for mutant in survivors(chosen, arguments.jobs):
        line = (CORE / mutant.file).read_text(encoding="utf-8").splitlines()[mutant.line - 1]
        print(f"{mutant}    {line.strip()}", flush=True)
        alive += 1
    killed = len(chosen) - alive
    print(f"{killed} of {len(chosen)} mutants killed, {100 * killed / len(chosen):.1f} %")
    return 0 if killed >= 0.9 * len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
