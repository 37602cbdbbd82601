"""Mutation test of firmware/core: builds it once per mutant and runs the tests that need no chip.

It fails unless the mutants that no test notices are exactly those of survivors.toml.

python -m tests.firmware.mutation.run                  all of them (`make mutation`)
python -m tests.firmware.mutation.run --sample 20      a random sample, by --seed
python -m tests.firmware.mutation.run --only pi.hpp battery.hpp:35:    those whose printed place starts so
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
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from multiprocessing import get_context
from multiprocessing.queues import SimpleQueue
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.firmware.core import host_interface  # noqa: F401  import once for all child processes
from tests.firmware.mutation.mutants import CORE, Mutant, mutants
from tests.firmware.mutation.survivors import Tally

TESTS = Path(__file__).resolve().parents[1] / "core"
SUITE = {
    "test_wheel": {"parameters.hpp"},
    "test_supervisor": {"supervisor.hpp"},
    "test_monitors": {"host_interface.hpp", "beep.hpp", "config.hpp"},
    "test_ramp_battery_units": {"parameters.hpp", "battery.hpp", "beep.hpp"},
    "test_host_interface": {"host_interface.hpp"},
    "test_store": {"host_interface.hpp"},
    "test_inputs": {"host_interface.hpp"},
    "test_robot_parameters": {"host_interface.hpp"},
    "test_quadrature": {"quadrature.hpp", "drive.hpp"},
    "test_framing": {"framing.hpp"},
    "test_model": {"parameters.hpp"},
    "test_law": {"parameters.hpp"},
    "test_pi": {"pi.hpp"},
    "test_gyro_heading": {"gyro_heading.hpp"},
    "test_acceleration": {"host_interface.hpp"},
}
"""The headers that a test exercises. Together with their includes, it can detect a change in these only. The
quick tests come first, because pytest stops at the first failure."""
OWN = {
    "acceleration.hpp": "test_acceleration",
    "battery.hpp": "test_ramp_battery_units",
    "beep.hpp": "test_ramp_battery_units",
    "config.hpp": "test_law",
    "crc.hpp": "test_framing",
    "drive.hpp": "test_quadrature",
    "feedforward.hpp": "test_model",
    "fixed.hpp": "test_law",
    "flash.hpp": "test_host_interface",
    "framing.hpp": "test_framing",
    "gyro_heading.hpp": "test_gyro_heading",
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
"""The test most likely to detect a change in a file; it runs first."""
INCLUDE = re.compile(r'#include "core/(.+)"')
LONG = re.compile("million|long_drive")
"""Tests that take seconds."""
Result = tuple[Mutant | None, str]
TIMEOUT_S = 10
"""Processor time of one test: a mutant in an endless loop counts as detected. The longest takes 1.2 s."""
MEMORY_BYTES = 2**30
"""An endless loop may also fill the memory."""
DETECTED, UNDETECTED = 1, 0
MIN_SHARE = 0.99
"""Of all mutants that are not listed as equivalent."""

# Which example fails does not matter here, so skip shrinking. A busy machine is no failure.
settings.register_profile(
    "mutation",
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=list(HealthCheck),
)


@cache
def reached(header: str) -> frozenset[str]:
    """Return a header of the core and everything it includes."""
    included = INCLUDE.findall((CORE / header).read_text(encoding="utf-8"))
    return frozenset({header}).union(*map(reached, included))


def suite_for(items: list[pytest.Item], file: str | None) -> list[pytest.Item]:
    """Return the tests that can detect a change in a file: the most likely first, the long ones last."""
    able = [name for name, roots in SUITE.items() if not file or any(file in reached(root) for root in roots)]
    able.sort(key=lambda name: name != OWN.get(file or ""))
    chosen = [item for item in items if item.path.stem in able]
    return sorted(chosen, key=lambda item: (bool(LONG.search(item.name)), able.index(item.path.stem)))


class Worker:
    """A pytest that collects once, then tests one mutant after another, each in its own process."""

    def __init__(
        self, folder: Path, chosen: Sequence[Mutant | None], report: Callable[[Result], None]
    ) -> None:
        self.folder, self.chosen, self.report = folder, chosen, report
        self.detected = defaultdict[str, Counter[str]](Counter)  # how many mutants of a file each test did

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Replace pytest's own loop."""
        if session.testsfailed:
            raise session.Failed("a test module cannot be imported")
        for mutant in self.chosen:
            self.report((mutant, self.test(session, mutant)))
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Store the message of the first failure and exit."""
        if report.failed:
            failure = self.folder / "failure"
            failure.write_text(f"{report.nodeid}\n{report.longreprtext}", encoding="utf-8")
            os._exit(DETECTED)

    def test(self, session: pytest.Session, mutant: Mutant | None) -> str:
        """Return which test detects this change in a copy of the core; empty if none does."""
        failure = self.folder / "failure"
        failure.write_text("no test ran", encoding="utf-8")
        for name in ("core", "build"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
        shutil.copytree(CORE, self.folder / "core")
        if mutant:
            path = self.folder / "core" / mutant.file
            path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")
        child = os.fork()
        if child == 0:
            try:
                resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
                file = mutant.file if mutant else None
                items = suite_for(session.items, file)
                items.sort(key=lambda item: -self.detected[file or ""][item.nodeid])
                for item, after in zip(items, [*items[1:], None], strict=True):
                    failure.write_text(f"{item.nodeid}\ncrashed", encoding="utf-8")
                    end_s = int(time.process_time()) + TIMEOUT_S
                    resource.setrlimit(resource.RLIMIT_CPU, (end_s, resource.RLIM_INFINITY))
                    item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            except BaseException:  # it does not compile
                os._exit(DETECTED)
            os._exit(UNDETECTED)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == UNDETECTED:
            return ""
        message = failure.read_text(encoding="utf-8")
        if mutant:
            self.detected[mutant.file][message.splitlines()[0]] += 1
        return message


def _work(chosen: Sequence[Mutant | None], results: "SimpleQueue[Result | None]") -> None:
    """Test these mutants in a process of its own, and put None at the end."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["THUMPER_MUTANT"] = folder
        os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # otherwise each process imports a browser's
        shutil.copytree(CORE, Path(folder) / "core")  # a test module reads it on import
        descriptor = os.open(Path(folder) / "log", os.O_WRONLY | os.O_CREAT)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        options = ["-q", "--hypothesis-profile=mutation", "-p", "no:cacheprovider"]
        options += ["-p", "pytest_timeout", "--timeout=0", "-p", "_hypothesis_pytestplugin"]
        modules = [str(TESTS / f"{name}.py") for name in SUITE]
        pytest.main([*options, *modules], plugins=[Worker(Path(folder), chosen, results.put)])
    results.put(None)


def results_of(chosen: Sequence[Mutant | None], jobs: int) -> Iterator[Result]:
    """Yield each mutant (None: the core unchanged) and the test that detected it, in order of completion."""
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
    """Return the failure of the suite on the unchanged core, or an empty string."""
    ((_, failure),) = results_of([None], jobs=1)
    return failure


def main() -> int:
    """Print the survivors and the share noticed; fail if they are not those of survivors.toml."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sample", type=int, default=0, help="sample size (0: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""], help="only mutants whose printed place starts so")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    if failure := fails_unchanged():
        print(failure)
        print("the suite fails on the unchanged core; fix that first")
        return 2
    every = mutants()
    chosen = [mutant for mutant in every if str(mutant).startswith(tuple(arguments.only))]
    if arguments.sample:
        chosen = random.Random(arguments.seed).sample(chosen, arguments.sample)
    tally = Tally(every)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # report the progress however it is stopped
    try:
        for mutant, failure in results_of(chosen, arguments.jobs):
            if mutant:
                tally.add(mutant, failure)
    except KeyboardInterrupt:
        tally.wrong.append(f"stopped after {tally.counts.total()} of {len(chosen)} mutants")
    for line in tally.wrong:
        print(line)
    kinds = ", ".join(f"{number} {kind}" for kind, number in tally.counts.items())
    print(f"{tally.counts.total()} mutants: {kinds}; {tally.share():.1%} of those not equivalent noticed")
    return int(bool(tally.wrong) or (len(chosen) == len(every) and tally.share() < MIN_SHARE))


if __name__ == "__main__":
    sys.exit(main())
