"""The page's server process, the pages of a headless browser and their processes."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from benchmarks.shared.live import END_WITH_PARENT, free_port, until
from playwright.sync_api import Page

CHROMIUM = "/usr/bin/chromium-headless-shell"
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
START_S = 60.0


class Server:
    """`thumper dashboard` in its own process."""

    def __init__(self, robot_address: str, folder: Path, *more: str, port: int | None = None) -> None:
        self.port = port or free_port()
        self.scheme = "http"
        self._log = folder / f"dashboard-{self.port}.log"
        self._command = [
            *(sys.executable, "-m", "thumper", "dashboard"),
            *("--bus", robot_address, "--port", str(self.port), *more),
        ]
        self.start()

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"{self.scheme}://localhost:{self.port}"

    def start(self) -> None:
        """Start, and wait until it answers."""
        with self._log.open("wb") as log:
            self.process = subprocess.Popen([*END_WITH_PARENT, *self._command], stdout=log, stderr=log)
        until(self._answers, START_S)

    def kill(self) -> None:
        """End it as a crash would."""
        self.process.kill()
        self.process.wait()

    def close(self) -> None:
        """End it as Ctrl-C would."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(START_S)

    def _answers(self) -> bool:
        log = self._log.read_text(encoding="utf-8")
        assert self.process.poll() is None, log
        return "press Ctrl-C to stop" in log  # before, it answers that it is starting


def open_page(page: Page, server: Server) -> None:
    """Open the page and wait until it shows the robot, which may still be compiling its kernels."""
    page.goto(server.url)
    page.wait_for_function(
        "window.thumper?.state.connected && window.thumper.state.values.status", timeout=120_000
    )
    page.wait_for_selector(".tp-map canvas")


def chromium_processes(root: int) -> list[int]:
    """Return a process and its descendants."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            stat = (entry / "stat").read_text()
        except OSError:
            continue
        parents.setdefault(int(stat.rpartition(")")[2].split()[1]), []).append(int(entry.name))
    found = [root]
    for process in found:
        found += parents.get(process, [])
    return found


def signal_all(processes: list[int], number: signal.Signals) -> None:
    """Send a signal to each process that is still alive."""
    for process in processes:
        with suppress(ProcessLookupError):
            os.kill(process, number)
