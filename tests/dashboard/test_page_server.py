"""The page in a real browser while its server or the robot restarts."""

import signal
from functools import partial
from pathlib import Path

import pytest
from benchmarks.shared.browser import Server
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import free_port, until
from playwright.sync_api import Browser, Page, expect

from tests.dashboard.test_page_manual import PAD
from tests.variants import some_of
from thumper.runtime.requests import EmergencyStop


def test_page_that_is_not_connected_yet_does_not_report_a_lost_connection(
    browser: Browser, server: Server
) -> None:
    page = browser.new_page()
    page.add_init_script("window.WebSocket = class { static OPEN = 1; readyState = 0; close() {} };")
    page.goto(server.url)
    expect(page.locator("#tp-banner")).to_have_text("Connecting to the dashboard server …")
    page.close()


@pytest.mark.slow
def test_page_reconnects_to_a_restarted_server(page: Page, server: Server, robot: FakeRobot) -> None:
    server.kill()
    expect(page.locator("#tp-banner")).to_contain_text("No connection")
    for name in (".tp-battery", ".tp-board", ".tp-arm"):
        expect(page.locator(name)).to_have_css("opacity", "0.45")  # not live
    expect(page.locator("[data-field=rtt]").first).to_have_text("\u2013")
    server.start()
    page.wait_for_function(
        "document.querySelector('#tp-banner')?.textContent === 'Simulated robot: Laboratory'"
    )
    # The page may be reloading at this moment: press stop until the page reports it.

    def pressed_and_said() -> bool:
        page.keyboard.press("Escape")
        return bool(robot.received_of(EmergencyStop))

    until(pressed_and_said)


@pytest.mark.parametrize("how", some_of(["Space", "gamepad"]))
def test_a_stop_without_a_connection_is_sent_as_soon_as_there_is_one(
    page: Page, server: Server, robot: FakeRobot, how: str
) -> None:
    server.kill()
    expect(page.locator("#tp-banner")).to_contain_text("No connection")
    robot.received.clear()  # a stop of the page before may have come late
    if how == "gamepad":
        page.evaluate(PAD, [False, 0.0, 1])
    else:
        page.keyboard.press("Space")
    expect(page.locator("#tp-notices")).to_contain_text("the emergency stop waits for it")
    assert not robot.received_of(EmergencyStop)
    server.start()
    until(partial(robot.received_of, EmergencyStop))


def test_a_stop_that_the_server_never_read_is_sent_again(
    page: Page, server: Server, robot: FakeRobot
) -> None:
    """As after a cut network: the browser takes messages, although nobody reads them."""
    server.process.send_signal(signal.SIGSTOP)
    robot.received.clear()
    page.keyboard.press("Space")
    server.kill()
    assert not robot.received_of(EmergencyStop)
    server.start()
    until(partial(robot.received_of, EmergencyStop))


def test_a_stop_that_arrived_is_not_sent_again(page: Page, server: Server, robot: FakeRobot) -> None:
    page.keyboard.press("Space")
    until(partial(robot.received_of, EmergencyStop))
    page.wait_for_function("sessionStorage.getItem('tp-waiting-stop') === null")


def test_page_reconnects_to_a_restarted_robot(browser: Browser, tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    server = Server(address, tmp_path)  # before there is a robot
    page = browser.new_page()
    banner = page.locator("#tp-banner")
    try:
        page.goto(server.url)
        expect(banner).to_have_text(f"No robot at {address}; start `thumper run`.")
        for name in ("Explore", "Cancel", "Save map", "Disarm", "Goal"):
            expect(page.get_by_role("button", name=name).first).to_be_disabled()
        for _ in range(2):
            robot = FakeRobot(address=address)
            expect(banner).to_have_text("Simulated robot: Laboratory")
            expect(page.get_by_role("button", name="Explore")).to_be_enabled()
            page.click(".tp-estop")
            until(partial(robot.received_of, EmergencyStop))
            robot.close()
            expect(banner).to_contain_text("No data from the robot")
            page.wait_for_function("document.querySelector('.tp-map').mapView.isLost")  # it draws no scan
    finally:
        page.close()
        server.close()
