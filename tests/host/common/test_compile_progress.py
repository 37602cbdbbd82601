"""The first run says once that it compiles, and at the end how much that was."""

import io

import numba
from rich.console import Console

from thumper.common.compile_progress import compile_progress

KERNELS = 12


def compile_some() -> None:
    for _ in range(KERNELS):
        numba.njit(lambda x: x + 1)(1)


def test_compiling_takes_two_lines() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written), "loading"):
        compile_some()
    assert written.getvalue().splitlines() == [
        "compiling for this computer, once: 1 to 2 minutes",
        f"compiled {KERNELS} kernels",
    ]


def test_a_terminal_shows_the_number_and_keeps_one_line() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written, force_terminal=True), "loading"):
        compile_some()
    kept = written.getvalue().rpartition("\x1b[2K")[2]
    assert "kernels so far" in written.getvalue()
    assert kept.count("\n") == 1
    assert f"compiled \x1b[1;36m{KERNELS}\x1b[0m kernels" in kept


def test_loaded_kernels_leave_nothing() -> None:
    written = io.StringIO()
    with compile_progress(Console(file=written), "loading"):
        pass
    assert written.getvalue() == ""
