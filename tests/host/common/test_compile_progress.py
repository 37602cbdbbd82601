"""The first run says once that it compiles, and at the end how much that was."""

import io
import re
import time

import numba
import pytest
from rich.console import Console

from thumper.common import compile_progress as compile_progress_module
from thumper.common.compile_progress import FIRST_START, compile_progress

KERNELS = 12


def compile_some() -> None:
    for _ in range(KERNELS):
        numba.njit(lambda x: x + 1)(1)


def test_compiling_shows_share_and_time_without_a_terminal_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_progress_module, "LINE_PERIOD_S", 0.05)
    written = io.StringIO()
    with compile_progress(Console(file=written), "loading", expected=9):
        compile_some()
        time.sleep(0.2)
    first, *lines, last = written.getvalue().splitlines()
    assert first == "compiling the mapping and planning code, once"
    assert lines
    assert all(re.fullmatch(r"\d?\d %, \d+ s", line) for line in lines)
    assert re.fullmatch(r"compiled in \d+ s", last)


def test_a_terminal_shows_the_share_and_keeps_one_line() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written, force_terminal=True), "loading"):
        compile_some()
    kept = written.getvalue().rpartition("\x1b[2K")[2]
    assert f"; {100 * KERNELS // FIRST_START} %, " in written.getvalue()
    assert kept.count("\n") == 1
    assert "compiled in " in kept


def test_loaded_kernels_leave_nothing() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written), "loading"):
        pass
    assert written.getvalue() == ""
