"""`thumper setup` in Chromium: a bare emulated board is flashed, and STOP ends the wheel check.

The check shows the speeds of the wheels.
"""

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from benchmarks.shared.browser import CHROMIUM, FLAGS
from playwright.sync_api import Page, expect, sync_playwright

from tests.e2e.first_run import Guided
from tests.page_checks import PHONE, POOR, TABLET, tab_to


def test_bare_board_is_flashed_and_stop_ends_the_wheel_check(tmp_path: Path) -> None:
    in_own_thread(follow, tmp_path)


@pytest.mark.slow
def test_last_steps_open_at_once(tmp_path: Path) -> None:
    in_own_thread(open_last_steps, tmp_path)


def in_own_thread(work: Callable[[Path], None], folder: Path) -> None:
    """Run in a thread of its own: other tests' browser runs a loop in this one."""
    if not Path(CHROMIUM).exists():
        pytest.skip(f"{CHROMIUM} is not there; `make test` installs it")
    with ThreadPoolExecutor(1) as thread:
        thread.submit(work, folder).result()


def check_contrast(page: Page) -> None:
    """Check the step that is shown in both themes, at 1024 px and on the phone, which stays."""
    for screen in (TABLET, PHONE):
        page.set_viewport_size(screen)
        for theme in ("dark", "light"):
            page.emulate_media(color_scheme=theme)
            page.wait_for_function(
                f"document.body.classList.contains('body--dark') === {str(theme == 'dark').lower()}"
            )
            page.wait_for_timeout(400)  # Quasar fades its fields
            assert page.evaluate(POOR) == [], (screen, theme)


def check_wiring_of_simulated_robot(page: Page) -> None:
    """Check that the drawing of the wiring does not ask for wires that nobody can see."""
    page.set_viewport_size(TABLET)
    expect(page.get_by_text("Simulated, as if wired like this.")).to_be_visible()
    expect(page.get_by_alt_text("Battery, board, motors")).to_be_in_viewport(ratio=1.0)


def press_by_keyboard(page: Page, name: str) -> None:
    """Press Tab until a button has the focus, which it shows, then Enter."""
    button = page.get_by_role("button", name=name, exact=True)
    expect(button).to_be_visible()
    tab_to(page, button)
    expect(button).to_have_css("outline-style", "solid")
    page.keyboard.press("Enter")


def open_last_steps(tmp_path: Path) -> None:
    """Open the page at these steps: the goal tool is chosen, although tools and map appear after the page."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        walk = Guided(browser.new_page(), tmp_path)
        with walk.server("goal"):
            expect(walk.page.locator("[data-tool=goal]")).to_be_disabled()
            walk.page.evaluate("thumper.state.values.map = {}")
            expect(walk.page.locator("[data-tool=goal]")).to_have_class("on")
            expect(walk.page.locator(".tp-toolbar")).to_be_visible()
            expect(walk.page.locator(".tg-wiring")).to_be_hidden()
            expect(walk.page.locator(".tg-now")).to_have_count(1)
        with walk.server("done"):
            expect(walk.page.locator(".tg-now")).to_contain_text("The robot is set up")
        browser.close()


def follow(tmp_path: Path) -> None:
    """Go through the first steps, up to the wheel check."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        page = browser.new_page(viewport=PHONE)
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        walk = Guided(page, tmp_path)
        with walk.server():
            page.goto(page.url.removesuffix("setup"))
            expect(page).to_have_url(re.compile("/setup$"))  # the dashboard has no robot to show yet
            banner = page.locator("#tp-banner")  # the page has a connection for STOP
            expect(banner).to_have_text("No robot is running yet: step 4 starts it.")
            page.set_viewport_size(TABLET)
            drawing = page.get_by_alt_text("Battery, board, motors")
            expect(drawing).to_be_visible()
            assert drawing.evaluate("one => one.naturalWidth") > 0
            for part in (".tp-toolbar", ".tp-chips", ".tp-state", ".tg-simulated"):
                expect(page.locator(part)).to_be_hidden()  # there is no robot and no map yet
            check_contrast(page)
            page.get_by_label("World of a simulated robot").click()
            page.get_by_role("option", name="House").click()
            walk.click("Use a simulated robot")
            walk.done("robot", "flash")
            walk.retried("flash", "check", ("Flash",))
            expect(page.locator(".tp-charts canvas").first).to_be_in_viewport(ratio=1.0)  # empty yet
            walk.click("Turn the wheels")
            expect(page.locator(".tg-output")).to_contain_text("firmware")  # seconds before the wheels turn
            expect(page.locator(".tg-output")).not_to_contain_text("USB")
            expect(page.get_by_role("button", name="Turn the wheels")).to_have_count(0)
            expect(page.get_by_role("button", name="Cancel")).to_be_enabled()
            stop = page.locator(".tp-estop").bounding_box()
            assert stop is not None
            assert stop["y"] + stop["height"] <= PHONE["height"]  # always in reach
            assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
            page.wait_for_function(
                "document.querySelector('.tp-wheels').charts.rows.some((row) => row[2] > 1)"
            )
            expect(page.locator(".tp-charts > div").nth(1)).to_be_in_viewport(ratio=1.0)
            expect(page.locator(".tg-output")).not_to_contain_text("wheels ")
            page.locator(".tp-estop").dispatch_event("pointerdown")
            expect(page.locator(".tg-outcome.tg-fail")).to_have_text("stopped: the wheels are not checked")
            expect(page.get_by_role("button", name="Turn the wheels")).to_be_enabled()
            check_contrast(page)
        written = (tmp_path / "robot.toml").read_text()
        with walk.server():
            expect(page.get_by_label("New configuration file")).to_have_value("robot_2.toml")
            press_by_keyboard(page, "Use robot.toml")
            walk.done("robot", "flash")
            check_wiring_of_simulated_robot(page)
        browser.close()
    assert not problems
    assert 'port = "sim://setup/board?world=house-4&' in written
    assert [(path.name, path.read_text()) for path in tmp_path.glob("*.toml")] == [("robot.toml", written)]
