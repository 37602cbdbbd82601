"""Edits of saved maps: what the server computes and saves, and how the page draws them."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.fake_robot import FakeRobot
from fastapi import FastAPI
from playwright.sync_api import Page, expect

from tests.dashboard.test_library import Client
from tests.dashboard.test_page_driving import drag
from thumper.common.geometry import Pose2
from thumper.dashboard.map_edits import BURST, MAX_EDITS, add_map_edits
from thumper.maps.annotations import (
    Annotations,
    SavedPlace,
    Zone,
    ZoneKind,
    load_annotations,
    save_annotations,
)
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import load_map, save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.saved_state import SavedSlamState, load_session, save_session

PLACE = SavedPlace(name="door", x_m=2.0, y_m=0.5, yaw_rad=0.0)
ZONE = Zone(name="rug", kind=ZoneKind.SLOW, vertices_m=((1.0, 0.5), (2.0, 0.5), (2.0, 1.0)))


def save_room(folder: Path, name: str) -> None:
    """Save a map of 3 x 2 m: free, its lower left corner at (0, 0), with a wall at x = 1."""
    cells = np.full((40, 60), FREE, dtype=np.int8)
    cells[:, 20] = OCCUPIED
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    save_map(grid, folder / f"{name}.yaml")
    save_annotations(Annotations(zones=(ZONE,), places=(PLACE,)), folder / f"{name}.geojson")
    pose = Pose2(x_m=2.0, y_m=1.0)
    save_session(
        SavedSlamState(counts=HitCounts.from_grid(grid), map_from_base=pose), folder / f"{name}.session"
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "library"
    folder.mkdir()
    save_room(folder, "room")
    save_room(tmp_path, "outside")
    return folder


@pytest.fixture
def client(folder: Path) -> Client:
    app = FastAPI()
    add_map_edits(app, folder)
    return Client(app)


def post(client: Client, content: Any, name: str = "room") -> Any:
    return client.request("POST", f"/library/maps/{name}/edit", content)


def test_a_rotated_map_is_saved_with_zones_places_and_session(client: Client, folder: Path) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    edits = [
        {"edit": "rotate", "angle_deg": 90.0},
        {"edit": "unknown", "corners_m": [-2.0, 2.0, -1.0, 3.0]},
        {"edit": "crop", "corners_m": [-1.5, 0.0, 0.0, 3.0]},
    ]
    assert post(client, {"edits": edits, "save_as": "turned"}).status_code == 200
    grid = load_map(folder / "turned.yaml")
    assert (grid.origin_x_m, grid.origin_y_m) == pytest.approx((-1.5, 0.0))
    assert grid.cells.shape == (60, 30)
    assert (grid.cells[20] == OCCUPIED).all()  # the wall, now at y = 1
    assert (grid.cells[40:, :10] == UNKNOWN).all()
    assert (grid.cells[40:, 10:] == FREE).all()
    (door,), (rug,) = (
        load_annotations(folder / "turned.geojson").places,
        load_annotations(folder / "turned.geojson").zones,
    )
    assert (door.x_m, door.y_m, door.yaw_rad) == pytest.approx((-0.5, 2.0, math.pi / 2))
    assert rug.polygon_m() == pytest.approx(np.array([(-0.5, 1.0), (-0.5, 2.0), (-1.0, 2.0)]))
    pose = load_session(folder / "turned.session", 0.05).map_from_base
    assert pose is not None
    assert (pose.x_m, pose.y_m, pose.theta_rad) == pytest.approx((-1.0, 2.0, math.pi / 2))
    assert {name: (folder / name).read_bytes() for name in before} == before


@pytest.mark.parametrize("suffix", [".pgm", ".session", ".geojson"])
def test_no_file_without_its_map_is_overwritten(client: Client, folder: Path, suffix: str) -> None:
    left = folder / f"attic{suffix}"
    left.write_text("mine")
    assert post(client, {"edits": [], "save_as": "attic"}).status_code == 422
    assert left.read_text() == "mine"


@pytest.mark.parametrize(
    "content",
    [
        {"edits": [], "save_as": "room"},  # taken
        {"edits": [], "save_as": "../room2"},
        {"edits": [], "save_as": ""},
        {"edits": [{"edit": "rotate", "angle_deg": 1e9}]},
        {"edits": [{"edit": "rotate", "angle_deg": "90"}]},
        {"edits": [{"edit": "free", "corners_m": [0.0, 0.0, 1.0]}]},
        {"edits": [{"edit": "free", "corners_m": [9.0, 9.0, 9.5, 9.5]}]},  # outside the map
        {"edits": [{"edit": "paint", "corners_m": [0.0, 0.0, 1.0, 1.0]}]},
        {"edits": [{"edit": "rotate", "angle_deg": 1.0}] * (MAX_EDITS + 1)},
        {"edits": [], "path": "/etc/passwd"},
        [],
    ],
)
def test_wrong_edits_are_refused(client: Client, folder: Path, content: Any) -> None:
    before = sorted(folder.parent.rglob("*"))
    assert post(client, content).status_code == 422
    assert sorted(folder.parent.rglob("*")) == before


def test_other_files_are_not_read_and_requests_are_limited(client: Client) -> None:
    for name in ("..%2Foutside", "none", ".room", "room.yaml"):
        assert post(client, {"edits": []}, name).status_code in (400, 404), name
    assert post(client, {"edits": [], "save_as": "x" * 40000}).status_code == 413
    assert 429 in [post(client, {"edits": [], "save_as": 1}).status_code for _ in range(3 * BURST)]


def test_the_page_edits_a_map(page: Page, robot: FakeRobot, library: Path) -> None:
    save_room(library, "room")
    maps = [{"name": "room", "MB": 0.1, "saved_s": time.time()}]
    page.route("**/library", lambda route: route.fulfill(json={"maps": maps, "recordings": []}))
    page.click(".tp-tab-map")
    page.click("[aria-label='Edit the map room']")
    expect(page.locator("#tp-banner")).to_contain_text("Editing the map room")
    shown = "document.querySelector('.tp-map').mapView"
    is_open = f"{shown}.grids.map?.info.columns === 60 && {shown}.pose === null"
    page.wait_for_function(is_open)
    drag(page, (0.525, 0.525), (1.525, 1.525))  # middles of cells
    page.click("[data-rotate]")
    page.wait_for_function(f"{shown}.grids.map.info.rows === 60")
    page.click(".tp-editor [data-undo]")
    page.wait_for_function(f"{shown}.grids.map.info.rows === 40")
    page.keyboard.press("Escape")  # back to the robot, the edits stay
    expect(page.locator("#tp-banner")).to_have_text("Simulated robot: Laboratory")
    page.click("[aria-label='Edit the map room']")
    page.wait_for_function(is_open)
    page.locator(".tp-editor select").select_option("crop")
    page.wait_for_function(f"{shown}.tools.tool === 'box'")
    drag(page, (0.025, 0.025), (1.975, 1.975))
    page.wait_for_function(f"{shown}.grids.map.info.columns === 40")
    page.locator(".tp-editor input[type=text]").fill("small")
    page.keyboard.press("Enter")
    expect(page.locator(".tp-notice.good")).to_have_text("saved the map small")
    expect(page.locator(".tp-editor")).to_be_hidden()
    cells = load_map(library / "small.yaml").cells
    assert cells.shape == (40, 40)
    assert (cells == UNKNOWN).sum() == 21 * 21
    assert robot.fault == 0
