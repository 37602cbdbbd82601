"""Measure how fast the page follows the robot: packet rate, latency from bus to drawn frame, CPU.

Run: python benchmarks/dashboard.py [--seconds S] [--side CELLS]

A robot publishes pose, a scan of 682 beams, wheels, particles and status 20 times per second on the bus. The
server is the real one. With --side, the room is in the middle of a map of this size, in which some cells
change twice per second. The browser is a headless Chromium with software rendering on the same computer.
Latency is the time from before the pose is published to the end of the frame that shows it. The other pages
of "10 pages" are plain websockets that receive every packet, because ten browsers would need more cores.
"""

import argparse
import asyncio
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright
from rich.console import Console
from rich.table import Table
from websockets.asyncio.client import connect

from thumper.common.geometry import Pose2
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, require_data
from benchmarks.shared.browser import CHROMIUM, FLAGS, Server, chromium_processes, open_page
from benchmarks.shared.fake_robot import FakeRobot, room
from benchmarks.shared.live import free_port

RATE_HZ = 20.0
WRAP_S = 50.0
OTHER_PAGES = 9
SMALL_CELLS = 100

# Record the age of each newly drawn pose; the robot's x encodes the time of the pose.
WATCH = """() => {
  const view = document.querySelector('.tp-map').mapView;
  const draw = view.draw.bind(view);
  let last = null;
  window.ages = [];
  view.draw = () => {
    draw();
    const x = view.pose?.[0];
    if (x === undefined || x === last) return;
    last = x;
    const now = ((performance.timeOrigin + performance.now()) / 1000) % WRAP;
    window.ages.push((now - x + WRAP) % WRAP);
  };
}""".replace("WRAP", str(WRAP_S))


class ClockRobot(FakeRobot):
    """Drives at 1 m/s, so that its position encodes the time."""

    def pose_at(self, cycle: int) -> Pose2:
        """Return a pose at x = current time; first change a block of cells of the map."""
        cells = self.grid.cells
        if cycle % 10 == 0 and len(cells) > SMALL_CELLS:
            cells, first = cells.copy(), len(cells) // 2 + cycle % 40
            cells[first : first + 30, first : first + 30] ^= OCCUPIED
            self.grid = replace(self.grid, cells=cells)
        return Pose2(x_m=time.time() % WRAP_S, y_m=1.5)


def cpu_s(processes: list[int]) -> float:
    """Return the CPU time that the processes have used [s]."""
    ticks = 0
    for process in processes:
        fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def measure(page: Page, server: Server, seconds: float) -> list[str]:
    """Measure for `seconds`; return a row."""
    browser = [
        process
        for process in chromium_processes(os.getpid())
        if "chrom" in Path(f"/proc/{process}/comm").read_text(encoding="utf-8")
    ]
    groups = ([server.process.pid], browser)
    page.evaluate("window.ages.length = 0")
    packets = page.evaluate("window.thumper.state.packets")
    before, begun_s = [cpu_s(group) for group in groups], time.monotonic()
    page.wait_for_timeout(1000 * seconds)
    took_s = time.monotonic() - begun_s
    used = [100.0 * (cpu_s(group) - was) / took_s for group, was in zip(groups, before, strict=True)]
    ages_ms = 1000.0 * np.array(page.evaluate("window.ages"))
    rate_Hz = (page.evaluate("window.thumper.state.packets") - packets) / took_s
    p50, p99 = np.percentile(ages_ms, (50, 99))
    return [
        f"{rate_Hz:.1f}",
        f"{len(ages_ms) / took_s:.1f}",
        f"{p50:.0f} / {p99:.0f}",
        f"{used[0]:.0f}",
        f"{used[1]:.0f}",
    ]


class OtherPages(threading.Thread):
    """The other pages, on their own thread."""

    def __init__(self, url: str, seconds: float, done: Callable[[float], None]) -> None:
        super().__init__()
        self._url, self._seconds, self._done = url, seconds, done
        self.start()

    def run(self) -> None:
        """Receive packets until the time is over."""
        asyncio.run(self._all())

    async def _all(self) -> None:
        await asyncio.gather(*(listen(self._url, self._seconds, self._done) for _ in range(OTHER_PAGES)))


async def listen(url: str, seconds: float, done: Callable[[float], None]) -> None:
    """Receive every packet as one page does; call `done` with the rate [Hz]."""
    async with connect(url, max_size=None) as socket:
        begun_s, packets = time.monotonic(), 0
        while time.monotonic() - begun_s < seconds:
            packets += isinstance(await socket.recv(), bytes)
        done(packets / seconds)


def grown(grid: OccupancyGrid, side: int) -> OccupancyGrid:
    """Return a free map of this side with the grid in its middle; the grid itself if it is not smaller."""
    rows, columns = grid.cells.shape
    if side <= max(rows, columns):
        return grid
    top, left = (side - rows) // 2, (side - columns) // 2
    cells = np.zeros((side, side), np.int8)
    cells[top : top + rows, left : left + columns] = grid.cells
    return replace(
        grid,
        cells=cells,
        origin_x_m=grid.origin_x_m - left * grid.resolution_m,
        origin_y_m=grid.origin_y_m - top * grid.resolution_m,
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=15.0, help="duration of each measurement")
    parser.add_argument("--side", type=int, default=SMALL_CELLS, help="side of the map [cells]")
    options = parser.parse_args()
    seconds, where = options.seconds, f"map of {options.side} cells" if options.side > SMALL_CELLS else "page"
    require_data(Path(CHROMIUM))
    table = Table(title=f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    for column in ("pages", "packets/s", "poses drawn/s", "latency p50 / p99 [ms]", "server %", "browser %"):
        table.add_column(column, justify="right")
    robot = ClockRobot(
        address=f"127.0.0.1:{free_port()}", period_s=1.0 / RATE_HZ, grid=grown(room(), options.side)
    )
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        server = Server(robot.address, Path(folder))
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        open_page(page, server)
        page.wait_for_timeout(3000)
        page.evaluate(WATCH)
        one = ["1", *measure(page, server, seconds)]
        table.add_row(*one)
        rates: list[float] = []
        others = OtherPages(server.url.replace("http", "ws") + "/stream", seconds + 2.0, rates.append)
        ten = [str(1 + OTHER_PAGES), *measure(page, server, seconds)]
        table.add_row(*ten)
        others.join()
        browser.close()
        server.close()
    robot.close()
    for row in (one, ten):
        pages, rate, _, late, server_share, _ = row
        figure(f"{where}, {pages} open: packets", rate, "per second", aim=">= 20")
        figure(
            f"{where}, {pages} open: bus to drawn frame, median / 99 %",
            late,
            "ms",
            aim="- / <= 50",
            peers="NiceGUI with a canvas 2 / 8",
            source="socket to page alone, a machine of the same kind",
        )
        figure(
            f"{where}, {pages} open: server's share of a core",
            server_share,
            "%",
            peers="NiceGUI 4",
            source="as above",
        )
    table.add_row("aim", "20", "20", "- / 50", "", "")
    Console().print(table)
    print(f"the other {OTHER_PAGES} pages: {min(rates):.1f}...{max(rates):.1f} packets/s each")


if __name__ == "__main__":
    main()
