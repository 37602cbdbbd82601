"""A new user's first drive: the kernels come with the package, and none is compiled."""

import os
import subprocess
import sys
from pathlib import Path

from thumper.common.numba_kernel import SHIP_VARIABLE

DRIVE = """
from numba.core import event
from rich.console import Console

with event.install_recorder("numba:compile") as compiled:
    from thumper_hil.demo.missions import MISSIONS
    from thumper_hil.demo.run import drive_mission

    outcome = drive_mission(MISSIONS[0], seed=3, realtime=False, console=Console(quiet=True))
print(outcome.result.reached, len(compiled.buffer))
"""


def run(*command: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, *command], env=os.environ | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_first_drive_with_an_empty_cache_compiles_nothing(tmp_path: Path) -> None:
    run("-m", "thumper_hil.demo.ship_kernels", **{SHIP_VARIABLE: "1"})  # what `make` did, for changed sources
    assert run("-c", DRIVE, NUMBA_CACHE_DIR=str(tmp_path)) == "True 0"
    assert not list(tmp_path.rglob("*.nb?"))
