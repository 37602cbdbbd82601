"""`thumper setup` in Chromium: a bare emulated board is flashed, and STOP ends the wheel check."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from benchmarks.shared.browser import CHROMIUM, FLAGS
from playwright.sync_api import expect, sync_playwright

from tests.e2e.first_run import PHONE, Guided


def test_bare_board_is_flashed_and_stop_ends_the_wheel_check(tmp_path: Path) -> None:
    if not Path(CHROMIUM).exists():
        pytest.skip(f"{CHROMIUM} is not there; `make test` installs it")
    with ThreadPoolExecutor(1) as thread:  # other tests' browser runs a loop in this one
        thread.submit(follow, tmp_path).result()


def follow(tmp_path: Path) -> None:
    """Go through the first steps, up to the wheel check."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        page = browser.new_page(viewport=PHONE)
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        walk = Guided(page, tmp_path)
        with walk.server():
            expect(page.locator("#tp-banner")).to_have_text(
                "Waiting for the robot …"
            )  # STOP has a connection
            page.get_by_label("World of a simulated robot").click()
            page.get_by_role("option", name="House").click()
            walk.click("Simulated robot")
            walk.done("robot", "flash")
            walk.retried("flash", "check", ("Flash",))
            walk.click("Turn the wheels")
            expect(page.get_by_text("Are all wheels off the ground?")).to_be_visible()
            walk.click("Yes, turn the wheels")
            expect(page.locator(".tg-output")).to_contain_text("pass")  # seconds before the wheels turn
            stop = page.locator(".tp-estop").bounding_box()
            assert stop is not None
            assert stop["y"] + stop["height"] <= PHONE["height"]  # always in reach
            assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
            page.locator(".tp-estop").dispatch_event("pointerdown")
            expect(page.locator(".tg-outcome.tg-fail")).to_have_text("stopped: the wheels are not checked")
            expect(page.get_by_role("button", name="Turn the wheels")).to_be_enabled()
        browser.close()
    assert not problems
    assert 'port = "sim://setup/board?world=house-4&' in (tmp_path / "robot.toml").read_text()
