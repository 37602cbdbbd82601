"""WCAG AA: contrast of all text in both themes and all states of the page; names; keyboard alone."""

import time
from pathlib import Path

import pytest
from benchmarks.shared.browser import Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Browser, Page, ViewportSize, expect

from tests.dashboard.test_map_edits import save_room
from tests.page_checks import DESK, PHONE, POOR, TABLET
from thumper.board.messages import Fault, State
from thumper.runtime.requests import Velocity

TABS = ("drive", "map", "gains", "tune", "sim", "log", "system")


@pytest.mark.parametrize(
    ("theme", "screen"),
    [
        pytest.param("light", DESK, id="light, screen"),
        pytest.param("dark", PHONE, id="dark, phone"),
        pytest.param("dark", DESK, id="dark, screen", marks=pytest.mark.slow),
        pytest.param("light", PHONE, id="light, phone", marks=pytest.mark.slow),
        pytest.param("light", TABLET, id="light, tablet"),
        pytest.param("dark", TABLET, id="dark, tablet"),
    ],
)
def test_all_text_can_be_read(
    browser: Browser, server: Server, robot: FakeRobot, library: Path, theme: str, screen: ViewportSize
) -> None:
    robot.reset()
    if not (library / "hut.yaml").exists():
        save_room(library, "hut")
    context = browser.new_context(viewport=screen, color_scheme=theme)  # type: ignore[arg-type]
    page = context.new_page()
    maps = [{"name": "hut", "MB": 0.1, "saved_s": time.time()}]
    page.route("**/library", lambda route: route.fulfill(json={"maps": maps, "recordings": []}))
    open_page(page, server)
    assert page.evaluate("document.body.classList.contains('body--dark')") == (theme == "dark")
    page.wait_for_timeout(300)  # Quasar fades the tab
    problems = {}
    for state in (State.DISARMED, State.CLOSED_LOOP):
        robot.state = state
        page.wait_for_function(f"document.body.dataset.board === '{state.name.lower()}'")
        problems[state.name] = page.evaluate(POOR)
    for localization in ("searching", "pose lost"):
        robot.localization = robot.pose_lost = localization
        page.wait_for_function(f"document.body.dataset.localization === '{localization.replace(' ', '_')}'")
        problems[localization] = page.evaluate(POOR)
    for tab in TABS:
        page.click(f".tp-tab-{tab}")
        page.wait_for_timeout(300)  # Quasar fades the tab
        problems[tab] = page.evaluate(POOR)
    page.click("[data-tool=layers]")
    page.keyboard.press("?")
    problems["layers, shortcuts"] = page.evaluate(POOR)
    page.keyboard.press("Escape")
    page.click(".tp-tab-map")
    page.click("[aria-label='Edit the map hut']")
    expect(page.locator("#tp-banner")).to_contain_text("Editing")
    problems["editor"] = page.evaluate(POOR)
    page.click("[aria-label='Delete hut']")
    robot.battery_V, robot.fault, robot.fault_words, robot.fault_cure = (
        6.4,
        Fault.E_STOP,
        "emergency stop",
        "press Arm",
    )
    robot.simulated = False
    try:
        page.keyboard.press("Escape")
        expect(page.locator("#tp-banner")).to_contain_text("Real robot")
        expect(page.locator(".tp-fault")).to_be_visible()
        problems["fault"] = page.evaluate(POOR)
    finally:
        robot.simulated = True
        context.close()
    assert not any(problems.values()), problems


def test_arrow_keys_drive_while_the_joystick_has_the_focus(page: Page, robot: FakeRobot) -> None:
    page.locator(".tp-stick").focus()
    page.keyboard.down("ArrowUp")
    until(lambda: any(request.twist.v_m_s > 0.0 for request in robot.received_of(Velocity)))
    page.keyboard.press("Tab")  # the focus leaves: the robot stops, though the key is still down
    until(lambda: robot.received_of(Velocity)[-1].twist.v_m_s == 0.0)
    page.keyboard.up("ArrowUp")
    page.locator(".tp-stick").focus()
    page.keyboard.down("ArrowLeft")
    until(lambda: robot.received_of(Velocity)[-1].twist.w_rad_s > 0.0)
    page.keyboard.up("ArrowLeft")
    until(lambda: robot.received_of(Velocity)[-1].twist.w_rad_s == 0.0)
