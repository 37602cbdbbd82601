"""`install-packages` without apt-get names what is missing; `install-python` counts the seconds."""

import os
import pty
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


def test_seconds_count_on_a_terminal_and_not_in_a_pipe(tmp_path: Path) -> None:
    slow = tmp_path / "python"
    slow.write_text("#!/bin/sh\nsleep 0.8\n")  # for pip, which installs uv, and for uv
    slow.chmod(0o755)
    command = ["scripts/install-python", str(slow), "package"]
    ours, theirs = pty.openpty()
    subprocess.run(command, cwd=ROOT, stdout=theirs, check=True)
    shown = b""
    while not shown.endswith(b"\r\x1b[K"):
        shown += os.read(ours, 1000)
    assert shown.startswith(b"\x1b[Kinstalling Python packages, 1 s\r")
    os.close(ours)
    os.close(theirs)
    assert subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout == b""
