"""The page in a real browser: every control and a drive to a goal, by keys alone."""

from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Page, expect

from tests.page_checks import MOST_CONTROLS, tab_to
from thumper.board.messages import Fault

# Keeps the visible controls that Tab reaches, and how each looks without the focus.
CONTROLS = """() => {
  window.look = (one) => {
    const { outlineStyle, outlineWidth, boxShadow } = getComputedStyle(one);
    return [outlineStyle, outlineWidth, boxShadow].join();
  };
  const all = document.querySelectorAll("button, input, select, a[href], summary, [tabindex]");
  window.controls = [...all].filter(
    (one) => one.tabIndex >= 0 && !one.disabled && one.checkVisibility({ visibilityProperty: true }));
  window.before = window.controls.map(look);
  return window.controls.map((one) => one.title || one.ariaLabel || one.textContent || one.outerHTML);
}"""
FOCUSED = "() => window.controls.indexOf(document.activeElement)"
HAS_RING = "k => look(window.controls[k]) !== window.before[k]"


def test_tab_reaches_every_control_and_shows_it(page: Page) -> None:
    names = page.evaluate(CONTROLS)
    reached: dict[int, bool] = {}
    for _ in range(MOST_CONTROLS):
        page.keyboard.press("Tab")
        at = page.evaluate(FOCUSED)
        if at >= 0:
            reached[at] = page.evaluate(HAS_RING, at)
    assert [name for at, name in enumerate(names) if at not in reached] == []
    assert [name for at, name in enumerate(names) if not reached[at]] == []


def test_keys_drive_stop_and_clear_the_fault(page: Page, robot: FakeRobot) -> None:
    tab_to(page, page.locator(".tp-tab-drive"))
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(page.locator(".tp-places")).to_be_visible()
    tab_to(page, page.locator(".tp-map canvas"))
    for key in ("g", "ArrowRight", "ArrowUp", "Enter"):
        page.keyboard.press(key)
    until(lambda: robot.goal is not None)
    page.keyboard.press("Space")
    expect(page.locator(".tp-fault")).to_be_visible()
    assert (robot.goal, robot.fault) == (None, Fault.E_STOP)
    tab_to(page, page.locator(".tp-fault > button"))
    page.keyboard.press("Enter")
    expect(page.locator(".tp-fault")).to_be_hidden()
    assert robot.fault == Fault.NONE


def test_the_list_of_shortcuts_takes_the_focus_and_gives_it_back(page: Page, robot: FakeRobot) -> None:
    dialog, close = page.locator(".tp-shortcuts"), page.locator(".tp-shortcuts button")
    for opener, key in (("[data-shortcuts]", "Enter"), (".tp-map canvas", "?")):
        tab_to(page, page.locator(opener))
        page.keyboard.press(key)
        expect(close).to_be_focused()
        for leave in ("Tab", "Shift+Tab"):
            page.keyboard.press(leave)
            expect(close).to_be_focused()
        page.keyboard.press("Escape")
        expect(dialog).to_be_hidden()
        expect(page.locator(opener)).to_be_focused()
    assert robot.fault == Fault.NONE
