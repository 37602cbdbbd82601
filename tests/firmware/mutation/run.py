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
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from multiprocessing import get_context
from multiprocessing.queues import SimpleQueue
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

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
LONG = re.compile("million|long_drive")
"""Which tests take seconds."""
Result = tuple[Mutant | None, str]
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


def suite_for(items: list[pytest.Item], file: str | None) -> list[pytest.Item]:
    """Return the tests that can notice a change of a file: the likeliest first, the long ones last."""
    able = [name for name, roots in SUITE.items() if not file or any(file in reached(root) for root in roots)]
    able.sort(key=lambda name: name != OWN.get(file or ""))
    chosen = [item for item in items if item.path.stem in able]
    return sorted(chosen, key=lambda item: (bool(LONG.search(item.name)), able.index(item.path.stem)))


class Worker:
    """A pytest that collects once, then tests one mutant after the other, each in a process of its own."""

    def __init__(self, folder: Path, chosen: Sequence[Mutant | None], tell: Callable[[Result], None]) -> None:
        self.folder, self.chosen, self.tell = folder, chosen, tell

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Stand in for pytest's own loop."""
        if session.testsfailed:
            raise session.Failed("a test module cannot be imported")
        for mutant in self.chosen:
            self.tell((mutant, self.test(session, mutant)))
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what the first failure says, and end with it."""
        if report.failed:
            failure = self.folder / "failure"
            failure.write_text(f"{report.nodeid}\n{report.longreprtext}", encoding="utf-8")
            os._exit(NOTICED)

    def test(self, session: pytest.Session, mutant: Mutant | None) -> str:
        """Return what notices that a copy of the core has this one change, or none: empty if nothing does."""
        failure = self.folder / "failure"
        failure.write_text("it did not get as far as a test", encoding="utf-8")
        for name in ("core", "build"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
        shutil.copytree(CORE, self.folder / "core")
        if mutant:
            path = self.folder / "core" / mutant.file
            path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")
        child = os.fork()
        if child == 0:
            try:
                resource.setrlimit(resource.RLIMIT_CPU, (TIMEOUT_S, TIMEOUT_S))
                items = suite_for(session.items, mutant.file if mutant else None)
                for item, after in zip(items, [*items[1:], None], strict=True):
                    item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            except BaseException:  # it does not compile
                os._exit(NOTICED)
            os._exit(UNNOTICED)
        noticed = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != UNNOTICED
        return failure.read_text(encoding="utf-8") if noticed else ""


def _work(chosen: Sequence[Mutant | None], results: "SimpleQueue[Result | None]") -> None:
    """In a process of its own: test these mutants, and say None at the end."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["THUMPER_MUTANT"] = folder
        os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # or each process imports a browser's
        shutil.copytree(CORE, Path(folder) / "core")  # a test module reads it as it is imported
        descriptor = os.open(Path(folder) / "log", os.O_WRONLY | os.O_CREAT)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        options = ["-q", "--hypothesis-profile=mutation", "-p", "no:cacheprovider"]
        options += ["-p", "pytest_timeout", "-p", "_hypothesis_pytestplugin"]
        modules = [str(TESTS / f"{name}.py") for name in SUITE]
        pytest.main([*options, *modules], plugins=[Worker(Path(folder), chosen, results.put)])
    results.put(None)


def results_of(chosen: Sequence[Mutant | None], jobs: int) -> Iterator[Result]:
    """Yield each mutant (None: the core unchanged), and what noticed it, as they are tested."""
    fork = get_context("fork")
    results = fork.SimpleQueue()
    workers = [
        fork.Process(target=_work, args=(chosen[job::jobs], results), daemon=True) for job in range(jobs)
    ]
    for worker in workers:
        worker.start()
    count, working = 0, jobs
    while working:
        result = results.get()
        if result is None:
            working -= 1
        else:
            count += 1
            yield result
    if count != len(chosen):
        raise RuntimeError(f"only {count} of {len(chosen)} mutants were tested")


def fails_unchanged() -> str:
    """Return what the suite says about the core as it is, if that is not good."""
    ((_, failure),) = results_of([None], jobs=1)
    return failure


def survivors(chosen: Sequence[Mutant], jobs: int) -> Iterator[Mutant]:
    """Yield the mutants that no test noticed, as they are found."""
    return (mutant for mutant, failure in results_of(chosen, jobs) if mutant and not failure)


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
    tested = alive = 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # however it is stopped, it says how far it got
    try:
        for mutant, failure in results_of(chosen, arguments.jobs):
            tested += 1
            if mutant and not failure:
                alive += 1
                line = (CORE / mutant.file).read_text(encoding="utf-8").splitlines()[mutant.line - 1]
                print(f"{mutant}    {line.strip()}", flush=True)
    except KeyboardInterrupt:
        print(f"stopped after {tested} of {len(chosen)} mutants")
    killed = tested - alive
    print(f"{killed} of {tested} mutants killed, {100 * killed / max(tested, 1):.1f} %")
    return 0 if tested and killed >= 0.9 * tested else 1


if __name__ == "__main__":
    sys.exit(main())
