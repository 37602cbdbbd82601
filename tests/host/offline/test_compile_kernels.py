"""Kernels are compiled in processes of their own whenever what is cached is not of the present sources."""

import subprocess
from pathlib import Path

import pytest

from thumper.offline.subprocesses import compile_in_subprocess
from thumper.slam.scan_matching.correlative import correlative_search


def test_what_other_sources_left_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    folder = Path(correlative_search._cache.cache_path)  # type: ignore[attr-defined]
    compile_in_subprocess("scan_match")
    (now,) = folder.glob("scan_match-*.compiled")
    old = now.rename(folder / "scan_match-of-an-older-version.compiled")
    compile_in_subprocess("scan_match")
    assert now.exists()
    assert not old.exists()

    def started(*_: object, **__: object) -> None:
        pytest.fail("nothing has changed since: no process is needed")

    monkeypatch.setattr(subprocess, "run", started)
    compile_in_subprocess("scan_match")
