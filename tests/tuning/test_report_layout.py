"""The report in a browser: it fits a laptop, a phone and four printed pages."""

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.browser import CHROMIUM, FLAGS
from benchmarks.shared.wheel_plant import Wheel, counted, steps_and_prbs
from playwright.sync_api import Browser, sync_playwright

from thumper_tuning.design.fixed_point import to_fixed_point
from thumper_tuning.design.gains import DesignOptions, design, nominal_model
from thumper_tuning.drive.verify import COLUMNS, Verification, tracking_error
from thumper_tuning.identify.motor import identify
from thumper_tuning.logs.read import read_logs
from thumper_tuning.report.page import BoardResults, write_report

LAPTOP_PX, PHONE_PX = (1280, 800), (390, 844)
LAYOUT = """() => {
  const images = [...document.querySelectorAll(".figures img")].map(i => i.getBoundingClientRect());
  const page = document.documentElement;
  return {columns: new Set(images.map(i => Math.round(i.left))).size, width: page.scrollWidth,
          height: page.scrollHeight, shown: page.clientWidth};
}"""


def drive(error_rad_s: float) -> Verification:
    """Return a drive of trapezoids, forward and backward, with noise."""
    rows = np.zeros((140, len(COLUMNS)))
    rows[:, 0] = 0.1 * np.arange(140)
    rows[:, 1], rows[:, 2] = 4.0, np.where(np.arange(140) < 70, 1.0, -1.0)
    rows[:, 3] = rows[:, 6] = rows[:, 2] * np.interp(np.arange(140) % 70, (0, 20, 35, 55), (0, 8, 8, 0))
    noise = np.random.default_rng(1).normal(0.0, error_rad_s, (140, 2))
    rows[:, [4, 7]] = rows[:, [3, 6]] + noise
    rows[:, [5, 8]], rows[:, 9] = 17.0 * rows[:, [3, 6]], 7.6
    gains = to_fixed_point(kp=6.0, ki=11.0, ks=19.0, kv=17.0, ka=1.3, acceleration=8.0)
    return Verification(gains=gains, rows=rows, tracking=(tracking_error(rows, 4.0),))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the report of both motors, with the drives before and after."""
    folder = tmp_path_factory.mktemp("report")
    time_s, pwm = 0.1 * np.arange(600.0), steps_and_prbs(600, seed=1)
    left, right = (counted(Wheel().drive(time_s, pwm, seed=seed)) for seed in (1, 2))
    np.savetxt(
        folder / "log.csv",
        np.column_stack((time_s, pwm, left, pwm, right)),
        header="time_s,left_pwm,left_counts,right_pwm,right_counts",
        delimiter=",",
        comments="",
    )
    motors = [identify([log]) for log in read_logs(folder / "log.csv")]
    result = design(*nominal_model(motors), DesignOptions())
    board = BoardResults(before=drive(0.2), after=drive(0.1), better=True)
    return write_report(folder / "report.html", motors, result, board)


def in_browser(work: Callable[[Browser], None]) -> None:
    """Run in a thread of its own: other tests' browser runs a loop in this one."""
    if not Path(CHROMIUM).exists():
        pytest.skip(f"{CHROMIUM} is not there; `make test` installs it")

    def open_browser() -> None:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
            work(browser)
            browser.close()

    with ThreadPoolExecutor(1) as thread:
        thread.submit(open_browser).result()


@pytest.mark.parametrize(
    ("size_px", "columns", "height_px"), [(LAPTOP_PX, 3, 4000), (PHONE_PX, 1, 7000)], ids=["laptop", "phone"]
)
def test_it_fits_the_width_of_a_screen(
    report: Path, size_px: tuple[int, int], columns: int, height_px: int
) -> None:
    def look(browser: Browser) -> None:
        page = browser.new_page(viewport={"width": size_px[0], "height": size_px[1]})
        page.goto(report.as_uri())
        layout = page.evaluate(LAYOUT)
        assert layout["width"] <= layout["shown"] == size_px[0]
        assert layout["columns"] == columns
        assert layout["height"] <= height_px

    in_browser(look)


def test_it_prints_on_four_pages(report: Path) -> None:
    def look(browser: Browser) -> None:
        page = browser.new_page()
        page.goto(report.as_uri())
        pages = re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4"))
        assert 1 <= len(pages) <= 4

    in_browser(look)
