"""Take control and Log out in a real browser."""

from pathlib import Path

from benchmarks.shared.browser import Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Browser, Page, expect

from thumper.runtime.requests import Heartbeat, Velocity

PASSWORD = "correct horse"


def push_stick(page: Page) -> None:
    """Press the joystick and push it forward."""
    box = page.locator(".tp-stick").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 0.35 * box["height"])


def moves(robot: FakeRobot) -> bool:
    return any(velocity.twist.v_m_s > 0.1 for velocity in robot.received_of(Velocity))


def test_second_page_drives_after_take_control_only(
    page: Page, browser: Browser, server: Server, robot: FakeRobot
) -> None:
    push_stick(page)
    until(lambda: moves(robot))
    page.mouse.up()
    first = until(lambda: {beat.source for beat in robot.received_of(Heartbeat)})
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    try:
        second = context.new_page()
        open_page(second, server)
        take = second.locator(".tp-other-operator [data-take-control]")
        expect(take).to_be_visible()
        expect(page.locator(".tp-other-operator [data-take-control]")).to_be_hidden()
        robot.received.clear()
        push_stick(second)
        second.wait_for_timeout(500)
        assert not moves(robot)  # the stick of a page without control does nothing
        second.mouse.up()
        expect(second.locator(".tp-notice")).to_have_count(1)  # however often it was refused
        expect(second.locator(".tp-notice").get_by_role("button", name="Take control")).to_be_visible()
        take.click()
        expect(take).to_be_hidden()
        expect(page.locator(".tp-other-operator [data-take-control]")).to_be_visible()
        expect(page.locator("body")).to_contain_text("Another page has taken control")
        second.wait_for_timeout(300)  # heartbeats that were on their way arrive
        robot.received.clear()
        push_stick(second)
        until(lambda: moves(robot))
        second.mouse.up()
        sources = {beat.source for beat in robot.received_of(Heartbeat)}
        assert sources
        assert not sources & first  # the first page no longer guards a motion
    finally:
        context.close()


def test_log_out_ends_the_session_in_the_browser(browser: Browser, robot: FakeRobot, tmp_path: Path) -> None:
    robot.reset()
    config = tmp_path / "robot.toml"
    config.write_text(f'[dashboard]\npassword = "{PASSWORD}"\n')
    server = Server(robot.address, tmp_path, "--config", str(config))
    context = browser.new_context()
    try:
        page, other = context.new_page(), context.new_page()
        page.goto(server.url)
        page.fill("[name=password]", "wrong")
        page.click("text=Log in")
        expect(page.locator("[role=alert]")).to_have_text("Wrong password.")
        page.fill("[name=password]", PASSWORD)
        with page.expect_navigation(url=f"{server.url}/"):  # another request would cancel the form's
            page.click("text=Log in")
        open_page(page, server)
        open_page(other, server)
        page.click("[title='Log out']")
        expect(page.locator("[name=password]")).to_be_visible()
        page.goto(server.url)
        expect(page.locator("[name=password]")).to_be_visible()  # going back does not help
        # The other tab of the same session ends, too: its websocket is closed.
        other.wait_for_function(
            "!window.thumper.state.connected || document.querySelector('[name=password]')"
        )
    finally:
        context.close()
        server.close()
