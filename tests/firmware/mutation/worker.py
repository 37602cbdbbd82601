"""Tests mutants one after another: a pytest that collects once, then forks for each of them."""

import os
import resource
import shutil
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.queues import SimpleQueue
from pathlib import Path

import pytest

from tests.firmware.mutation.mutants import FIRMWARE, Mutant

MEMORY_BYTES = 2**30
"""An endless loop may also fill the memory."""
DETECTED, UNDETECTED = 1, 0

Result = tuple[Mutant | None, str]
"""A mutant (None: the code unchanged) and the test that detected it; empty if none did."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is changed, and the tests of it."""

    within: str
    """Folder of the firmware that a mutant's file is relative to."""
    modules: Sequence[Path]
    options: Sequence[str]
    """Of pytest."""
    suite: Callable[[list[pytest.Item], str], list[pytest.Item]]
    """Return the tests that can detect a change in a file, the most likely first."""
    prepare: Callable[[Path], str]
    """Build the copy; return why no test is needed, or an empty string."""
    timeout_s: int
    """Processor time of one test: a mutant in an endless loop counts as detected."""


class Worker:
    """A pytest that collects once, then tests one mutant after another, each in its own process."""

    def __init__(
        self,
        subject: Subject,
        folder: Path,
        chosen: Sequence[Mutant],
        report: Callable[[Result], None],
    ) -> None:
        self.subject, self.folder, self.chosen, self.report = subject, folder, chosen, report
        self.detected = defaultdict[str, Counter[str]](Counter)  # how many mutants of a file each test did

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Replace pytest's own loop: all mutants, then the code unchanged."""
        if session.testsfailed:
            raise session.Failed("a test module cannot be imported")
        for mutant in [*self.chosen, None]:
            self.report((mutant, self.test(session, mutant)))
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Store the message of the first failure and exit."""
        if report.failed:
            failure = self.folder / "failure"
            failure.write_text(f"{report.nodeid}\n{report.longreprtext}", encoding="utf-8")
            os._exit(DETECTED)

    def test(self, session: pytest.Session, mutant: Mutant | None) -> str:
        """Return which test detects this change in a copy; empty if none does.

        Unchanged (None), only the tests that detected something run.
        """
        failure = self.folder / "failure"
        failure.write_text("no test ran", encoding="utf-8")
        copy_sources(self.subject, self.folder, mutant)
        if (verdict := self.subject.prepare(self.folder / "firmware")) and mutant:
            return verdict
        items = self.items(session, mutant)
        if not items:
            return ""
        child = os.fork()
        if child == 0:
            try:
                resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
                for item, after in zip(items, [*items[1:], None], strict=True):
                    failure.write_text(f"{item.nodeid}\ncrashed", encoding="utf-8")
                    end_s = int(time.process_time()) + self.subject.timeout_s
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

    def items(self, session: pytest.Session, mutant: Mutant | None) -> list[pytest.Item]:
        """Return the tests to run, those first that detected most mutants of the file."""
        if mutant is None:
            detected = {name for names in self.detected.values() for name in names}
            return [item for item in session.items if item.nodeid in detected]
        items = self.subject.suite(session.items, mutant.file)
        return sorted(items, key=lambda item: -self.detected[mutant.file][item.nodeid])


def copy_sources(subject: Subject, folder: Path, mutant: Mutant | None) -> None:
    """Copy the firmware, with the mutant's change."""
    copy = folder / "firmware"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build"))
    if mutant:
        path = copy / subject.within / mutant.file
        path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")


def _work(subject: Subject, chosen: Sequence[Mutant], results: "SimpleQueue[Result | None]") -> None:
    """Test these mutants in a process of its own, and put None at the end."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["THUMPER_MUTANT"] = f"{folder}/firmware"
        os.environ["THUMPER_FIRMWARE"] = f"{folder}/firmware/build"
        os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # otherwise each process imports a browser's
        copy_sources(subject, Path(folder), None)  # a test module reads it on import
        descriptor = os.open(Path(folder) / "log", os.O_WRONLY | os.O_CREAT)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        options = ["-q", "-p", "no:cacheprovider", "-p", "pytest_timeout", "--timeout=0", *subject.options]
        pytest.main(
            [*options, *map(str, subject.modules)],
            plugins=[Worker(subject, Path(folder), chosen, results.put)],
        )
    results.put(None)


def results_of(subject: Subject, chosen: Sequence[Mutant], jobs: int) -> Iterator[Result]:
    """Yield each mutant and the test that detected it; with None, which of them fails without a change."""
    fork = get_context("fork")
    results = fork.SimpleQueue()
    workers = [fork.Process(target=_work, args=(subject, chosen[job::jobs], results)) for job in range(jobs)]
    for worker in workers:
        worker.start()
    count, working = 0, jobs
    try:
        while working:
            result = results.get()
            if result is None:
                working -= 1
            else:
                count += result[0] is not None
                yield result
    finally:
        for worker in workers:
            worker.terminate()
    if count != len(chosen):
        raise RuntimeError(f"only {count} of {len(chosen)} mutants were tested")
