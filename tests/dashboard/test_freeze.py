"""A page that drives the robot manually freezes, and the robot stops: real firmware, bus and browser."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmarks.shared.browser import CHROMIUM, FLAGS, Server, chromium_processes, open_page, signal_all
from benchmarks.shared.live import END_WITH_PARENT, free_port, until
from playwright.sync_api import BrowserType

from thumper.bus.client import BusClient
from thumper.ros.codec import Message
from thumper.ros.from_ros import stamp_ns_of

STOP_S = 0.5
BEAT_S = 0.1  # the last command falls somewhere between two of the robot's reports


@pytest.fixture
def robot_address(tmp_path: Path) -> Iterator[str]:
    """`thumper run` in simulation."""
    address = f"127.0.0.1:{free_port()}"
    config = tmp_path / "robot.toml"
    config.write_text(f'[bus]\naddress = "{address}"\n', encoding="utf-8")
    board = "sim://freeze/board?world=lab&x_m=1.7&y_m=0.1&yaw_deg=180&seed=1"
    process = subprocess.Popen(
        [
            *END_WITH_PARENT,
            *(sys.executable, "-m", "thumper", "run", "--config", str(config)),
            *("--board", board, "--lidar", "sim://freeze/lidar", "--start", "1.7", "0.1", "180"),
            *("--out", str(tmp_path / "out")),
        ],
        stdout=subprocess.DEVNULL,
    )
    yield address
    process.send_signal(signal.SIGINT)
    process.wait(20.0)


def test_frozen_page_stops_the_robot(robot_address: str, tmp_path: Path, chromium: BrowserType) -> None:
    server = Server(robot_address, tmp_path)
    statuses: list[Message] = []
    last_alive: list[Message] = []  # the robot's status when the page's newest command went by
    try:
        browser = chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        open_page(page, server)
        page.wait_for_function("window.thumper.state.values.map")
        with BusClient("thumper", robot_address) as client:
            client.subscribe("status", statuses.append)
            client.subscribe("teleop", lambda _: last_alive.append(statuses[-1]))
            page.get_by_role("button", name="Arm", exact=True).click()
            until(lambda: statuses and statuses[-1].mode == "holding")
            page.focus(".tp-stick")
            page.keyboard.down("ArrowUp")
            until(lambda: last_alive and last_alive[-1].mode == "manual")
            frozen = [
                process
                for process in chromium_processes(os.getpid())
                if "chrom" in Path(f"/proc/{process}/comm").read_text(encoding="utf-8")
            ]
            signal_all(frozen, signal.SIGSTOP)
            try:
                until(lambda: statuses[-1].mode != "manual")
                before = last_alive[-1]
            finally:
                signal_all(frozen, signal.SIGCONT)
            after = next(s for s in statuses if stamp_ns_of(s) > stamp_ns_of(before) and s.mode != "manual")
        browser.close()
    finally:
        server.close()
    assert before.mode == "manual"
    assert 1e-9 * (stamp_ns_of(after) - stamp_ns_of(before)) <= STOP_S + BEAT_S
