"""The product as a user runs it: the installed command, in a process of its own."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

THUMPER = Path(sys.executable).with_name("thumper")


@pytest.fixture
def thumper() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `thumper` with these arguments to its end."""

    def run(*arguments: str | Path, timeout_s: float = 120.0) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [THUMPER, *map(str, arguments)], capture_output=True, text=True, timeout=timeout_s, check=False
        )

    return run
