"""Kernels are compiled in subprocesses, but only if the sources changed since the last time."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import thumper
from thumper.common.kernel_files import FOLDER
from thumper.offline.compile_kernels import INCOMPLETE

COMPILE = """
import sys

from thumper.offline.subprocesses import compile_in_subprocess

sys.executable = sys.argv[1]
compile_in_subprocess("scan_match")
"""
MAP = """
from thumper.slam.factory import MappingOptions, make_mapper
from thumper.slam.scan_matching.correlative import correlative_search

make_mapper(MappingOptions(method="scan_match")).warm_up()
stats = correlative_search.compiled.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


class Installation:
    """A copy of the package with a cache of its own, and the interpreter that it starts to compile."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._starts, self._interpreter = folder / "starts", folder / "interpreter"
        self.cache = folder / "cache"
        shutil.copytree(
            Path(thumper.__file__).parent,
            folder / "thumper",
            ignore=shutil.ignore_patterns("__pycache__", FOLDER),
        )
        self.source = folder / "thumper" / "slam" / "mapper.py"
        self.let_compiler(f'exec "{sys.executable}" "$@"')

    def let_compiler(self, *ends: str) -> None:
        """Set the shell command of each start; the last one is for all later starts."""
        cases = [f"{number}) {end};;" for number, end in enumerate(ends[:-1], start=self.starts + 1)]
        self._interpreter.write_text(
            f'#!/bin/sh\necho "$@" >> {self._starts}\n'
            f"case $(wc -l < {self._starts}) in\n{' '.join(cases)} *) {ends[-1]};; esac\n"
        )
        self._interpreter.chmod(0o755)

    @property
    def starts(self) -> int:
        """How often the interpreter was started to compile."""
        return len(self._starts.read_text().splitlines()) if self._starts.exists() else 0

    def compile(self) -> None:
        """Do what `thumper replay` does before it needs the kernels."""
        self.run(COMPILE, str(self._interpreter))

    def run(self, program: str, *arguments: str) -> str:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(self.cache), "PYTHONPATH": str(self._folder)}
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture
def installation(tmp_path: Path) -> Installation:
    return Installation(tmp_path)


@pytest.mark.slow
def test_kernels_come_from_disk_after_they_were_compiled_in_subprocesses(installation: Installation) -> None:
    installation.compile()
    assert 2 <= installation.starts <= 12  # it reached its memory limit and continued in a new process
    files = {path: path.stat().st_mtime_ns for path in installation.cache.rglob("*.nbc")}
    assert files
    hits, misses = map(int, installation.run(MAP).split())
    assert hits > 0
    assert misses == 0
    assert {path: path.stat().st_mtime_ns for path in installation.cache.rglob("*.nbc")} == files


def test_kernels_are_compiled_once_per_version_of_the_sources(installation: Installation) -> None:
    installation.let_compiler("exit 0")
    first = installation.source.stat().st_mtime_ns
    for changed_ns, starts in ((0, 1), (0, 1), (10**9, 2), (10**9, 2), (0, 3)):
        os.utime(installation.source, ns=(first, first + changed_ns))
        installation.compile()
        assert installation.starts == starts


@pytest.mark.slow
def test_compiling_continues_in_a_new_process(installation: Installation) -> None:
    installation.let_compiler(f"exit {INCOMPLETE}", f"exit {INCOMPLETE}", "exit 0")
    installation.compile()
    installation.compile()
    assert installation.starts == 3


@pytest.mark.slow
def test_failed_compilation_is_repeated_next_time(installation: Installation) -> None:
    installation.let_compiler("exit 1")
    installation.compile()
    installation.compile()
    assert installation.starts == 2
