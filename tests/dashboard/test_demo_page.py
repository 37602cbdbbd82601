"""What a page shows of `thumper demo --ui` while no robot of the demo runs."""

import socket
import time
from dataclasses import replace

from benchmarks.shared.browser import Server, open_page
from benchmarks.shared.live import free_port, until
from playwright.sync_api import Browser

from thumper.bus.client import BusClient
from thumper.config.robot import RobotConfig
from thumper.dashboard.process import open_pages
from thumper.ros.from_ros import status_of
from thumper.ros.status import Status
from thumper_hil.demo.free_ports import on_free_ports
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


def test_server_counts_the_open_pages(browser: Browser, server: Server) -> None:
    page = browser.new_page()
    open_page(page, server)
    page.wait_for_function("window.thumper?.state.packets > 0")
    assert open_pages(f"{server.url}/") == 1
    page.close()
    until(lambda: open_pages(f"{server.url}/") == 0)
    assert open_pages(f"http://localhost:{free_port()}/") is None


def test_the_demo_takes_other_ports_than_those_in_use() -> None:
    config = RobotConfig()
    taken = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
    page, bus = (server.getsockname()[1] for server in taken)
    busy = replace(
        config,
        dashboard=replace(config.dashboard, port=page),
        bus=config.bus.at(f"127.0.0.1:{bus}"),
    )
    chosen = on_free_ports(busy)
    for server in taken:
        server.close()
    assert chosen.dashboard.port not in (page, bus)
    assert chosen.bus.address not in (busy.bus.address, f"127.0.0.1:{page}")
    assert on_free_ports(busy) == busy  # now they are free
