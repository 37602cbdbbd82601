"""Programs that tests start end with the tests, even if those are killed."""

import signal
import subprocess
import sys
from pathlib import Path

from benchmarks.shared.live import END_WITH_PARENT, until

PARENT = """
import subprocess, sys, time
from benchmarks.shared.live import END_WITH_PARENT

print(subprocess.Popen([*END_WITH_PARENT, *sys.argv[1:]], stdout=subprocess.DEVNULL).pid, flush=True)
time.sleep(600)
"""


def test_a_simulator_ends_when_its_test_is_killed(tmp_path: Path) -> None:
    thumper = Path(sys.executable).with_name("thumper")
    simulator: list[str | Path] = [
        thumper,
        "sim",
        "--board-pty",
        tmp_path / "board",
        "--lidar-pty",
        tmp_path / "lidar",
    ]
    command: list[str | Path] = [*END_WITH_PARENT, sys.executable, "-c", PARENT, *simulator]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        process = Path("/proc", parent.stdout.readline().strip())
        until((tmp_path / "board").exists)
        assert process.exists()
        parent.send_signal(signal.SIGKILL)
    until(lambda: not process.exists(), timeout_s=20.0)
    assert not (tmp_path / "board").is_symlink()  # it ended as by Ctrl-C
