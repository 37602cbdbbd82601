"""`scripts/install-packages` without apt-get looks for the programs and names what is missing."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("gcc-avr", "avr-libc", "binutils-avr", "libsimavr-dev", "g++", "python3-venv")


def _install(folder: Path) -> "subprocess.CompletedProcess[str]":
    command = ["/bin/sh", "scripts/install-packages", *PACKAGES]
    return subprocess.run(
        command, cwd=ROOT, env={"PATH": str(folder)}, capture_output=True, text=True, check=False
    )


def test_it_names_what_is_missing(tmp_path: Path) -> None:
    done = _install(tmp_path)
    assert done.returncode == 1
    first, *rest = done.stderr.splitlines()
    assert "no apt-get" in first
    assert [line.partition(":")[0].strip() for line in rest] == list(PACKAGES)
    assert "gcc-avr: the compiler avr-gcc" in done.stderr


def test_it_goes_on_where_all_is_there(tmp_path: Path) -> None:
    for name in ("avr-gcc", "avr-objcopy", "g++"):
        (tmp_path / name).write_text("#!/bin/sh\nexit 0\n")
        (tmp_path / name).chmod(0o755)
    (tmp_path / "python3").symlink_to(sys.executable)
    done = _install(tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
