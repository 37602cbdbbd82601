"""`thumper run --ui` starts with its page or not at all; the page runs as long as the robot."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from benchmarks.shared.live import free_port, until

from tests.variants import some_of
from thumper.common.errors import EXIT_NOT_THERE
from thumper.dashboard.process import open_pages


@pytest.mark.parametrize(
    ("taken", "hint"),
    some_of(
        [
            ("page", "another port with --ui-port"),
            ("option", "another port with --ui-port"),
            ("bus", "Choose another address"),
        ]
    ),
)
def test_port_in_use_is_reported_before_the_robot_is_opened(taken: str, hint: str, tmp_path: Path) -> None:
    board, lidar = (os.ttyname(os.openpty()[1]) for _ in range(2))  # ports that are there, and silent
    ports = {"page": free_port(), "option": free_port(), "bus": free_port()}
    option = ["--ui-port", str(ports["option"])] if taken == "option" else []
    config = tmp_path / "robot.toml"
    config.write_text(
        f'[board]\nport = "{board}"\n[lidar]\nport = "{lidar}"\n[bus]\naddress = "127.0.0.1:{ports["bus"]}"\n'
        f"[dashboard]\nport = {ports['page']}\n",
        encoding="utf-8",
    )
    with socket.create_server(("127.0.0.1", ports[taken])):
        done = subprocess.run(
            [sys.executable, "-m", "thumper", "run", "--ui", "--config", config, "--out", tmp_path, *option],
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == EXIT_NOT_THERE
    assert done.stderr.startswith("thumper: ")
    assert done.stderr.count("\n") == 1
    assert f"127.0.0.1:{ports[taken]}" in done.stderr
    assert hint in done.stderr


PARENT = """
import sys, time
from pathlib import Path
from thumper.dashboard.process import dashboard_process

with dashboard_process(Path(sys.argv[1]), "127.0.0.1:1") as url:
    print(url, flush=True)
    time.sleep(600)
"""


class Beside:
    """A process with its page, as `thumper run --ui` starts it."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        config = folder / "robot.toml"
        config.write_text(f"[dashboard]\nport = {self.port}\n", encoding="utf-8")
        self.log = folder / "log"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-c", PARENT, config], stdout=log, stderr=log, cwd=Path.cwd()
            )
        until(self.answers)

    def answers(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def pages(self) -> dict[int, str]:
        """Return the states of the child processes."""
        found = {}
        for stat in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                fields = stat.read_text().rpartition(")")[2].split()
                if int(fields[1]) == self.process.pid:
                    found[int(stat.parent.name)] = fields[0]
        return found


@pytest.fixture
def beside(tmp_path: Path) -> Iterator[Beside]:
    beside = Beside(tmp_path)
    yield beside
    beside.process.kill()
    beside.process.wait()
    until(lambda: not beside.answers())


def test_page_ends_with_its_parent(beside: Beside) -> None:
    until(lambda: open_pages(f"http://localhost:{beside.port}/") == 0)  # it runs
    assert beside.log.read_text() == f"http://localhost:{beside.port}/\n"
    beside.process.kill()  # no chance to clean up
    beside.process.wait()
    until(lambda: not beside.answers(), 20.0)


def test_page_that_dies_is_reported_and_starts_again(beside: Beside) -> None:
    (page,) = beside.pages()
    os.kill(page, signal.SIGKILL)
    until(lambda: "the dashboard has ended (signal 9); it starts again in 1 s" in beside.log.read_text())
    until(beside.answers)
    (again,) = beside.pages()  # and no zombie
    assert again != page
    assert beside.pages()[again] != "Z"
    beside.process.send_signal(signal.SIGINT)
    beside.process.wait(30.0)
    assert not beside.answers()
    assert len(re.findall("the dashboard has ended", beside.log.read_text())) == 1  # not for the wanted end
