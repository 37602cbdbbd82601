"""Walk through `thumper setup` in Chromium, from a bare emulated board to a saved map; count and time it.

Run: .venv/bin/python -m tests.e2e.first_run [--phone] [--dark] [--pictures FOLDER]
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.shared.browser import CHROMIUM, FLAGS
from benchmarks.shared.live import END_WITH_PARENT, free_port, until
from playwright.sync_api import Page, expect, sync_playwright

from tests.page_checks import DESK, PHONE

STEP_TIMEOUT_MS = 900_000  # exploring at 0.2 m/s takes minutes
BUSY_MS = 120_000  # a busy computer takes its time for each click
TRIES = 3  # a busy computer delays the emulated board as a loose cable would

BEGIN_AT = """
import sys
from thumper.__main__ import main
from thumper.dashboard.guide.guide import Guide, Step

Guide.connect = lambda self, robot, connect=Guide.connect: (connect(self, robot), self.begin(Step(step)))
step = sys.argv.pop(1)
main()
"""


class Guided:
    """One walk: `thumper setup` in a folder of its own, and a page that shows it."""

    def __init__(self, page: Page, folder: Path, pictures: Path | None = None) -> None:
        self.page = page
        self.folder = folder
        self.clicks = 0
        self.took: list[tuple[str, int, float]] = []  # step, clicks and seconds so far
        self._pictures = pictures
        self._begun_s = time.monotonic()
        page.set_default_timeout(BUSY_MS)
        expect.set_options(timeout=BUSY_MS)

    @contextmanager
    def server(self, step: str = "robot") -> Iterator[None]:
        """Run `thumper setup` and open its page; a step other than the first begins without its robot."""
        port = free_port()
        program = ("-m", "thumper") if step == "robot" else ("-c", BEGIN_AT, step)
        command = (sys.executable, *program, "setup", "--port", str(port))
        process = subprocess.Popen(
            [*END_WITH_PARENT, *command, "--bus", f"127.0.0.1:{free_port()}"],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert process.stdout is not None
            url = re.search(r"http://\S+/setup", until(process.stdout.readline))
            assert url is not None
            self.page.goto(url[0])
            self._now(step)
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(120)

    def click(self, text: str) -> None:
        """Click a button of the current step."""
        self.page.get_by_role("button", name=text, exact=True).click()
        self.clicks += 1

    def done(self, step: str, following: str) -> None:
        """Wait until the following step is shown; note clicks and time."""
        self._now(following)
        self.took.append((step, self.clicks, time.monotonic() - self._begun_s))
        print(f"{self.took[-1][2]:6.0f} s {self.clicks:3} clicks  {step}: {self.result(step)}", flush=True)

    def result(self, step: str) -> str:
        """Return the line that the page shows for a step that is done."""
        return self.page.locator(f".tg-step[data-name={step}] .tg-result").inner_text(timeout=STEP_TIMEOUT_MS)

    def picture(self, name: str) -> None:
        """Save a picture of the page, if they are wanted."""
        if self._pictures is not None:
            self._pictures.mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=self._pictures / f"{name}.png")

    def outcome(self, verdict: str) -> None:
        """Wait for the outcome of the current step."""
        expect(self.page.locator(f".tg-outcome.tg-{verdict}")).to_be_visible(timeout=STEP_TIMEOUT_MS)

    def retried(self, step: str, following: str, buttons: tuple[str, ...]) -> None:
        """Do a step with the emulated board, again if the busy computer delayed it."""
        for _ in range(TRIES):
            for text in buttons:
                self.click(text)
            expect(self.page.locator(".tg-outcome.tg-fail")).to_be_hidden()  # of the last time
            ended = f".tg-now:not([data-name={step}]), .tg-outcome:is(.tg-fail, .tg-warn)"
            expect(self.page.locator(ended)).to_be_visible(timeout=STEP_TIMEOUT_MS)
            if self.page.locator(".tg-outcome.tg-warn").is_visible():
                self.click("Continue")
            if not self.page.locator(".tg-outcome.tg-fail").is_visible():
                break
        self.done(step, following)

    def repeated(self, buttons: tuple[str, ...]) -> None:
        """Let the robot drive until that succeeds.

        On a busy computer the robot refuses a late request, and the board stops when commands are late.
        """
        passed, failed = (self.page.locator(f".tg-outcome.tg-{verdict}") for verdict in ("pass", "fail"))
        refused = self.page.locator(".tp-notice.bad")
        for _ in range(TRIES):
            for text in buttons:
                self.click(text)
            expect(failed).to_be_hidden()
            expect(passed.or_(failed).or_(refused).first).to_be_visible(timeout=STEP_TIMEOUT_MS)
            if passed.is_visible():
                return
            print(failed.or_(refused).first.inner_text(), flush=True)
            expect(refused).to_have_count(0)
        raise AssertionError(f"{buttons[0]} failed {TRIES} times")

    def _now(self, step: str) -> None:
        expect(self.page.locator(f".tg-now[data-name={step}]")).to_be_visible(timeout=STEP_TIMEOUT_MS)


def bare_board_to_running_robot(walk: Guided) -> None:
    """Choose the simulated robot, flash its bare board, turn its wheels and start it on the floor."""
    walk.picture("1-robot")
    walk.click("Use a simulated robot")
    walk.done("robot", "flash")
    walk.retried("flash", "check", ("Flash",))
    walk.picture("3-check")
    walk.retried("check", "start", ("Turn the wheels",))
    walk.picture("4-start")
    walk.click("Start the robot")
    walk.done("start", "tune")


def running_robot_to_saved_map(walk: Guided) -> None:
    """Tune, drive, explore, drive to a goal, save."""
    walk.picture("5-tune")
    walk.repeated(("Tune",))
    is_better = walk.page.get_by_text("Keep the gains").count()
    walk.click("Keep the gains" if is_better else "Continue")
    walk.done("tune", "drive")
    walk.click("Arm")
    _drive_ahead(walk)
    walk.outcome("pass")
    walk.picture("6-drive")
    walk.click("Continue")
    walk.done("drive", "map")
    walk.repeated(("Explore",))
    walk.picture("7-map")
    walk.click("Continue")
    walk.done("map", "goal")
    _send_goal(walk, 0.8, 0.0)
    walk.outcome("pass")
    walk.picture("8-goal")
    walk.click("Continue")
    walk.done("goal", "save")
    walk.click("Save the map")
    walk.done("save", "done")
    walk.picture("9-done")
    assert list(walk.folder.glob("**/first_map.yaml")), "no map was saved"
    expect(walk.page.locator(".tg-now pre")).to_contain_text("--map library/first_map.yaml")


def _drive_ahead(walk: Guided) -> None:
    """Hold the joystick ahead until the page says that it is enough."""
    stick = walk.page.locator(".tp-stick")
    stick.scroll_into_view_if_needed()
    box = stick.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    walk.page.mouse.move(x, y)
    walk.page.mouse.down()
    walk.page.mouse.move(x, y - 0.35 * box["height"], steps=4)
    walk.outcome("pass")
    walk.page.mouse.up()
    walk.clicks += 1


def _send_goal(walk: Guided, x_m: float, y_m: float) -> None:
    """Press a place on the map; the page has chosen the goal tool."""
    expect(walk.page.locator("[data-tool=goal]")).to_have_class("on")
    x, y = walk.page.evaluate(
        """([x_m, y_m]) => {
          const view = document.querySelector('.tp-map').mapView;
          const box = view.canvas.getBoundingClientRect();
          const [x, y] = view.camera.toScreen(x_m, y_m);
          return [x + box.left, y + box.top];
        }""",
        [x_m, y_m],
    )
    walk.page.mouse.click(x, y)
    walk.clicks += 1


def main() -> None:
    """Walk; every step prints clicks and seconds so far."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--phone", action="store_true")
    parser.add_argument("--dark", action="store_true")
    parser.add_argument("--pictures", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        page = browser.new_page(
            viewport=PHONE if options.phone else DESK,
            color_scheme="dark" if options.dark else "light",
        )
        walk = Guided(page, Path(folder), options.pictures)
        with walk.server():
            bare_board_to_running_robot(walk)
            running_robot_to_saved_map(walk)
        browser.close()
    print(f"load average at the end: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
