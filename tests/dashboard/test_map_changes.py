"""The pages receive what has changed in the map; together it equals the whole map."""

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import free_port, until
from PIL import Image
from playwright.sync_api import Page

from thumper.bus.client import BusClient
from thumper.bus.map_feed import MapFeed
from thumper.bus.server import BusServer
from thumper.common.geometry import Pose2
from thumper.config.bus import BusOptions
from thumper.dashboard.page_state import PageState
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.maps.cell_changes import CellBox, RenderHistory
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid
from thumper.ros.codec import Message
from thumper.ros.from_ros import stamp_ns_of
from thumper.ros.to_ros import Messages, map_change
from thumper.runtime.service.request_queue import RequestQueue
from thumper.slam.grid.growing_grid import HitGrid

M = Messages()


class Robot:
    """Publishes a map on a real bus as the robot's publisher does."""

    def __init__(self) -> None:
        self.address = f"127.0.0.1:{free_port()}"
        self.server = BusServer("r1", BusOptions(address=self.address), RequestQueue(), print)
        self._map: Message | None = None
        self._history: RenderHistory | None = None

    def publish(self, time_s: float, grid: OccupancyGrid, *, lost: bool = False) -> bool:
        """Publish a map; `lost`: its change does not arrive. Return whether it is a change of the last."""
        before, self._map = self._map, M.grid(time_s, grid)
        changed = grid.changed_since(self._history)
        self._history = grid.history
        self.server.publish("map", 0.0, self._map)
        if not lost:
            self.server.publish("map_changes", 0.0, map_change(before, self._map, changed))
        return changed is not None


class PageMap:
    """The map as one page puts it together."""

    def __init__(self) -> None:
        self.info: dict[str, Any] = {}
        self.cells: CellArray = np.empty((0, 0), np.int8)
        self.pixels = 0  # received

    def take(self, packet: bytes) -> None:
        """Take in a packet."""
        length = int.from_bytes(packet[:4], "little")
        header = json.loads(packet[4 : 4 + length])
        if "map" not in header:
            return
        offset, count, _ = header["arrays"]["map"]
        png = packet[4 + length + offset : 4 + length + offset + count]
        part = (np.asarray(Image.open(io.BytesIO(png))).astype(np.int16) - 1).astype(np.int8)
        self.info = header["map"]
        self.pixels += part.size
        if (patch := self.info.pop("patch", None)) is None:
            self.cells = part
        else:
            row, column, rows, columns = patch
            self.cells[row : row + rows, column : column + columns] = part


@pytest.fixture
def robot_on_bus() -> Iterator[Robot]:
    robot = Robot()
    yield robot
    robot.server.close()


def scan(rng: np.random.Generator) -> ScanPoints:
    return ScanPoints(
        origins_m=np.zeros((30, 2)), ends_m=rng.uniform(-2.0, 2.0, (30, 2)), kinds=np.full(30, HIT, np.uint8)
    )


def test_page_has_the_whole_map_after_each_change(robot_on_bus: Robot) -> None:
    """The map grows in each direction, changes are lost, some come between two packets, pages open late."""
    rng, hit_grid = np.random.default_rng(0), HitGrid(0.05, 0.5, 0.25)
    times_s = iter(range(10_000))
    state = PageState(Pose2(), lambda: float(next(times_s)))  # each tick is due
    early = PageMap()
    stamps_ns: list[int] = []
    changes = 0

    def on_message(topic: str, message: Message) -> None:
        state.on_message(topic, message)
        stamps_ns.append(stamp_ns_of(message))

    def has_come(stamp_ns: int) -> bool:
        return stamp_ns in stamps_ns

    ends = [Pose2(x_m=x_m, y_m=y_m) for x_m, y_m in ((4.0, 0.0), (0.0, 4.0), (-8.0, 0.0), (0.0, -8.0))]
    corners = set()
    with BusClient("r1", robot_on_bus.address) as client:
        MapFeed(client, on_message)
        for cycle in range(80):
            end, share = ends[cycle // 20], (cycle % 20) / 20
            hit_grid.insert(Pose2(x_m=end.x_m * share, y_m=end.y_m * share), scan(rng))
            grid = hit_grid.grid(percent=False)
            corners.add((grid.origin_x_m, grid.origin_y_m, grid.cells.shape))
            lost = cycle % 9 == 5
            changes += robot_on_bus.publish(100.0 + cycle, grid, lost=lost)
            if lost:
                continue
            until(partial(has_come, round(1e9 * (100.0 + cycle))))
            if cycle % 4 == 2:
                continue
            early.take(state.tick({}))
            late = PageMap()
            late.take(state.full_packet({}))
            for page in (early, late):
                np.testing.assert_array_equal(page.cells, grid.cells)
                assert page.info["origin"] == [grid.origin_x_m, grid.origin_y_m]
    assert len(corners) >= 5
    assert changes > 60
    assert early.pixels < 0.5 * 80 * grid.cells.size  # parts, not whole maps


def test_restarted_robot_has_another_map() -> None:
    robot = Robot()
    received: list[int] = []
    grid = OccupancyGrid(cells=np.zeros((3, 4), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    with BusClient("r1", robot.address) as client:
        robot.publish(100.0, grid)
        MapFeed(client, lambda topic, message: received.append(stamp_ns_of(message)))
        until(lambda: received == [100_000_000_000])
        robot.server.close()
        robot.server = BusServer("r1", BusOptions(address=robot.address), RequestQueue(), print)
        robot.publish(50.0, replace(grid, cells=grid.cells + np.int8(100)))  # its clock was set back
        until(lambda: received == [100_000_000_000, 50_000_000_000])
    robot.server.close()


def test_a_change_outside_the_map_is_refused() -> None:
    state = PageState(Pose2())
    grid = OccupancyGrid(cells=np.zeros((3, 4), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    state.on_message("map", M.grid(1.0, grid))
    change = map_change(M.grid(1.0, grid), M.grid(2.0, grid), CellBox(0, 0, 3, 4))
    change.column = 1
    state.on_message("map_changes", change)
    page = PageMap()
    page.take(state.tick({}))
    np.testing.assert_array_equal(page.cells, grid.cells)


DRAWN = """() => {
  const { info, cells, canvas } = document.querySelector('.tp-map').mapView.grids.map;
  const pixels = canvas.getContext('2d').getImageData(0, 0, info.columns, info.rows).data;
  const walls = [];
  for (let k = 0; k < cells.length; k += 1) {
    const at = 4 * ((info.rows - 1 - Math.floor(k / info.columns)) * info.columns + k % info.columns);
    if (pixels[at + 3] && pixels[at] < 128) walls.push(k); // the light theme draws walls dark
  }
  return { cells: Array.from(cells), walls, columns: info.columns };
}"""


def shown_as(page: Page, grid: OccupancyGrid) -> bool:
    """Return whether the page has drawn this map."""
    drawn = page.evaluate(DRAWN)
    return bool(
        drawn["columns"] == grid.cells.shape[1]
        and np.array_equal(drawn["cells"], grid.cells.reshape(-1).astype(int) + 1)
        and np.array_equal(drawn["walls"], np.flatnonzero(grid.cells.reshape(-1) == 100))
    )


def test_browser_draws_changes_into_the_map(page: Page, robot: FakeRobot) -> None:
    page.emulate_media(color_scheme="light")
    page.wait_for_function("document.querySelector('.tp-map').mapView.grids.map")
    until(lambda: shown_as(page, robot.grid))
    page.evaluate("window.thumper.state.values.map.isTheFirst = true")
    cells = robot.grid.cells.copy()
    cells[20:24, 40:50], cells[50:58, 60:70] = 100, 0
    robot.grid = replace(robot.grid, cells=cells)
    until(lambda: shown_as(page, robot.grid))
    assert page.evaluate("window.thumper.state.values.map.isTheFirst")
    robot.grid = robot.grid.including(-2.0, -2.0, 0.0)  # the map grows
    until(lambda: shown_as(page, robot.grid))
    assert not page.evaluate("window.thumper.state.values.map.isTheFirst")
