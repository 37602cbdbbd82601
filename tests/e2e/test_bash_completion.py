"""Tab in a real bash, which splits words at `:` and `=`."""

import os
import pty
import re
import select
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

WAIT_S = 20.0  # a busy machine; a completion takes 0.5 s
CALL = "import sys; sys.argv = ['thumper']; import thumper.__main__ as m; m.main()"

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")


class Bash:
    """An interactive bash on a pseudo-terminal."""

    def __init__(self, folder: Path) -> None:
        self._port, theirs = pty.openpty()
        self.process = subprocess.Popen(
            ["bash", "--norc", "--noprofile", "-i"],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            cwd=folder,
            env=os.environ | {"PATH": f"{folder}:{os.environ['PATH']}", "TERM": "dumb", "PS1": "> "},
            start_new_session=True,
        )
        os.close(theirs)
        self._read = ""

    def type(self, keys: str, until: str) -> str:
        """Type keys; return what the terminal shows up to a pattern."""
        os.write(self._port, keys.encode())
        end_s = time.monotonic() + WAIT_S
        while not (found := re.search(until, self._read)):
            ready, _, _ = select.select([self._port], [], [], max(0.0, end_s - time.monotonic()))
            assert ready, f"no {until!r} in {self._read!r}"
            self._read += os.read(self._port, 4096).decode().replace("\a", "")
        shown, self._read = self._read[: found.end()], self._read[found.end() :]
        return shown

    def close(self) -> None:
        """End the shell."""
        self.process.kill()
        self.process.wait()
        os.close(self._port)


@pytest.fixture
def bash(tmp_path: Path) -> Iterator[Bash]:
    program = tmp_path / "thumper"
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -c "{CALL}"\n')
    program.chmod(0o755)
    shell = Bash(tmp_path)
    try:
        shell.type("eval \"$(_THUMPER_COMPLETE=source_bash thumper)\"; echo re''ady\n", "ready")
        yield shell
    finally:
        shell.close()


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("thumper watch po", "thumper watch pose "),
        ("thumper run --board sim://?world=lab_", "thumper run --board sim://?world=lab_box "),
        ("thumper run --board=sim://?world=ha", "thumper run --board=sim://?world=hall "),
        ("thumper run --board 'sim://?world=lab_", "thumper run --board 'sim://?world=lab_box' "),
        ("thumper run --board sim:", "thumper run --board sim://"),
    ],
)
def test_tab_completes_the_word(typed: str, completed: str, bash: Bash) -> None:
    bash.type(f"{typed}\t", re.escape(completed))
