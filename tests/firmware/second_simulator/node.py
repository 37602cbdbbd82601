"""Runs a script of this folder in Node.js, with the modules of the robot in the browser."""

import json
import subprocess
from pathlib import Path

import pytest

BROWSER = Path(__file__).resolve().parents[3] / "hil/browser"


def is_installed() -> bool:
    """Return whether the simulator that the scripts use is installed."""
    return (BROWSER / "node_modules/avr8js").exists()


def run_script(name: str, job: object) -> str:
    """Return what a script prints for a job; skip the test if its modules are not installed."""
    if not is_installed():
        pytest.skip("avr8js is not installed; `make docs` installs it")
    script = Path(__file__).with_name(name)
    done = subprocess.run(
        ["node", str(script)], input=json.dumps(job), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
