"""Kernels are compiled in subprocesses, but only if the sources changed since the last time."""

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from thumper.offline import compile_kernels, subprocesses
from thumper.offline.subprocesses import compile_in_subprocess


class FakeCompiler:
    """Stands in for the processes: records each start and returns the next exit code."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.starts = 0
        self.codes: list[int] = []
        self._monkeypatch = monkeypatch
        cache = SimpleNamespace(_cache=SimpleNamespace(cache_path=str(folder)))
        monkeypatch.setattr(subprocesses, "correlative_search", cache)
        monkeypatch.setattr(subprocess, "run", self._run)
        self.set_sources("first")

    def set_sources(self, digest: str) -> None:
        self._monkeypatch.setattr(subprocesses, "_sources", lambda: digest)

    def _run(self, command: list[str], **_: Any) -> "subprocess.CompletedProcess[bytes]":
        self.starts += 1
        assert command[-1] == "scan_match"
        return subprocess.CompletedProcess(command, self.codes.pop(0) if self.codes else 0)


@pytest.fixture
def compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakeCompiler:
    return FakeCompiler(monkeypatch, tmp_path)


def test_kernels_are_compiled_once_per_version_of_the_sources(compiler: FakeCompiler) -> None:
    for digest, starts in (("first", 1), ("first", 1), ("second", 2), ("second", 2), ("first", 3)):
        compiler.set_sources(digest)
        compile_in_subprocess("scan_match")
        assert compiler.starts == starts


def test_compiling_continues_in_a_new_process(compiler: FakeCompiler) -> None:
    compiler.codes = [compile_kernels.INCOMPLETE, compile_kernels.INCOMPLETE, 0]
    compile_in_subprocess("scan_match")
    compile_in_subprocess("scan_match")
    assert compiler.starts == 3


def test_failed_compilation_is_repeated_next_time(compiler: FakeCompiler) -> None:
    compiler.codes = [1]
    compile_in_subprocess("scan_match")
    compile_in_subprocess("scan_match")
    assert compiler.starts == 2
