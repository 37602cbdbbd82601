"""The first run says once that it compiles, and at the end how much that was."""

import io

import numba
import pytest
from rich.console import Console

from thumper.common import compile_progress as compile_progress_module
from thumper.common.compile_progress import FIRST_START, compile_progress

KERNELS = 12


def compile_some() -> None:
    for _ in range(KERNELS):
        numba.njit(lambda x: x + 1)(1)


def test_compiling_shows_the_number_without_a_terminal_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_progress_module, "COUNTED_KERNELS", 5)
    written = io.StringIO()
    with compile_progress(Console(file=written), "loading", expected=9):
        compile_some()
    assert written.getvalue().splitlines() == [
        "compiling for this computer, once: 1 to 2 minutes",
        "5 of about 9 kernels",
        "10 kernels",
        f"compiled {KERNELS} kernels",
    ]


def test_a_terminal_shows_the_number_and_keeps_one_line() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written, force_terminal=True), "loading"):
        compile_some()
    kept = written.getvalue().rpartition("\x1b[2K")[2]
    assert f"; {KERNELS} of about {FIRST_START} kernels" in written.getvalue()
    assert kept.count("\n") == 1
    assert f"compiled \x1b[1;36m{KERNELS}\x1b[0m kernels" in kept


def test_loaded_kernels_leave_nothing() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written), "loading"):
        pass
    assert written.getvalue() == ""
