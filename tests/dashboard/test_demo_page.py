"""What a page shows of `thumper demo --ui` while no robot of the demo runs."""

import time
from dataclasses import replace

from benchmarks.shared.browser import Server
from benchmarks.shared.live import free_port, until
from playwright.sync_api import Page

from thumper.bus.client import BusClient
from thumper.config.robot import RobotConfig
from thumper.dashboard.process import open_pages
from thumper.ros.from_ros import status_of
from thumper.ros.status import Status
from thumper_hil.demo.in_browser import DemoBus


def test_between_two_robots_the_pages_hear_what_happens() -> None:
    address = f"127.0.0.1:{free_port()}"
    config = RobotConfig()
    bus = DemoBus(replace(config, bus=config.bus.at(address)))
    client = BusClient(config.name, address)
    heard: list[tuple[float, Status]] = []
    try:
        bus.notice = "starting mission 2"
        client.subscribe("status", lambda message: heard.append((time.monotonic(), status_of(message))))
        until(lambda: len(heard) > 3)
    finally:
        client.close()
        bus.close()
    assert {(status.mode, status.reason) for _, status in heard} == {("idle", "starting mission 2")}
    assert heard[-1][0] - heard[-2][0] < 1.5  # or the page reports a lost link


def test_server_counts_the_open_pages(page: Page, server: Server) -> None:
    page.wait_for_function("window.thumper?.state.packets > 0")
    assert open_pages(f"{server.url}/") == 1
    page.close()
    until(lambda: open_pages(f"{server.url}/") == 0)
    assert open_pages(f"http://localhost:{free_port()}/") is None
