"""For pages in a real browser: sizes of screens, text that is hard to read, and a way by keys."""

from pathlib import Path

from playwright.sync_api import Locator, Page, ViewportSize

DESK: ViewportSize = {"width": 1440, "height": 900}
TABLET: ViewportSize = {"width": 1024, "height": 768}
PHONE: ViewportSize = {"width": 390, "height": 844}

POOR = (Path(__file__).parent / "dashboard" / "contrast.js").read_text(encoding="utf-8")
"""To evaluate in a page: lists the texts whose contrast is below WCAG AA."""

MOST_CONTROLS = 80
"""A page has fewer."""


def tab_to(page: Page, control: Locator) -> None:
    """Press Tab until a control has the focus."""
    for _ in range(MOST_CONTROLS):
        page.keyboard.press("Tab")
        if control.evaluate("one => one === document.activeElement"):
            return
    raise AssertionError(f"Tab does not reach {control}")
