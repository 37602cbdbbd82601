"""Measure how fast the page appears and how much it loads, with an empty cache.

Run: python benchmarks/page_load.py [--loads 5]
"""

import argparse
import sys
import tempfile
from pathlib import Path
from statistics import median

from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.shared.browser import CHROMIUM, FLAGS, Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import free_port

PAINT_S = "performance.getEntriesByName('first-contentful-paint')[0].startTime / 1000"


def load(browser: Browser, server: Server) -> tuple[float, float, float]:
    """Load the page once; return the first contentful paint [s], the size [MB] and the robot's map [s]."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page = context.new_page()
    devtools = context.new_cdp_session(page)
    devtools.send("Network.enable")
    sizes: list[float] = []
    devtools.on("Network.loadingFinished", lambda event: sizes.append(event["encodedDataLength"]))
    open_page(page, server)
    page.wait_for_function("document.querySelector('.tp-map').mapView.grids.map")
    map_s = page.evaluate("performance.now() / 1000")
    paint_s = page.evaluate(PAINT_S)
    page.wait_for_timeout(1000)  # icons and fonts
    context.close()
    return paint_s, 1e-6 * sum(sizes), map_s


def main() -> None:
    """Load the page some times and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loads", type=int, default=5)
    loads = parser.parse_args().loads
    robot = FakeRobot(address=f"127.0.0.1:{free_port()}")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        server = Server(robot.address, Path(folder))
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        paints_s, sizes_MB, maps_s = zip(*(load(browser, server) for _ in range(loads)), strict=True)
        for what, times_s, aim in (("first paint", paints_s, "<= 1.5"), ("map drawn", maps_s, "")):
            times = f"{median(times_s):.2f} ({min(times_s):.2f} to {max(times_s):.2f})"
            figure(f"page, {what}, empty cache", times, "s", aim=aim)
        figure("page, transferred, empty cache", f"{median(sizes_MB):.2f}", "MB")
        browser.close()
        server.close()
    robot.close()


if __name__ == "__main__":
    main()
