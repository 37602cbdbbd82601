"""A new user's first drive and first tuning: the kernels come with the package, and none is compiled."""

import os
import subprocess
import sys
from pathlib import Path

from tests.firmware.board.boot import ROOT
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
IDENTIFY = """
from numba.core import event

with event.install_recorder("numba:compile") as compiled:
    from tests.tuning.test_coasting import simulated_log
    from thumper_tuning.identify.motor import identify

    motor = identify([simulated_log(coasts=True)])
    motor.compare(backlash=True)
print(round(motor.model.gain, 3), len(compiled.buffer))
"""


def run(*command: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, *command],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_first_drive_and_tuning_with_an_empty_cache_compile_nothing(tmp_path: Path) -> None:
    run("scripts/ship_kernels.py", **{SHIP_VARIABLE: "1"})  # what `make` did, for changed sources
    assert run("-c", DRIVE, NUMBA_CACHE_DIR=str(tmp_path)) == "True 0"
    assert run("-c", IDENTIFY, NUMBA_CACHE_DIR=str(tmp_path)) == "0.058 0"
    assert not list(tmp_path.rglob("*.nb?"))
