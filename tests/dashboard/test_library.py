"""The library on the page: what it lists, downloads and refuses. No browser but for the list."""

import asyncio
import io
import time
import zipfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from fastapi import FastAPI
from httpx import ASGITransport, AsyncClient, Response
from playwright.sync_api import Page, Route, expect

from tests.dashboard.test_page_driving import queries_of
from thumper.common.errors import ThumperError
from thumper.dashboard.library import add_library
from thumper.maps.library import delete_item, list_maps, list_recordings, rename_item
from thumper.runtime.service.library import map_in_use
from thumper.slam.localization.amcl import Amcl
from thumper.slam.mode_switch import SlamModeSwitch


class Robot:
    """Answers with the content of its folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def query(self, name: str, _payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        assert (name, source) == ("library/list", "")
        maps, recordings = list_maps(self.folder), list_recordings(self.folder)
        return {"ok": True, "maps": maps, "recordings": recordings, "in_use": ""}


class Client:
    """Sends requests to the routes."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app

    def get(self, path: str) -> Response:
        return self.request("GET", path)

    def request(self, method: str, path: str, content: Any = None) -> Response:
        async def send() -> Response:
            async with AsyncClient(transport=ASGITransport(self._app), base_url="http://page") as client:
                return await client.request(method, path, json=content)

        with ThreadPoolExecutor(1) as thread:  # browser tests of this process may have left a loop running
            return thread.submit(asyncio.run, send()).result()


@pytest.fixture
def client(tmp_path: Path) -> Client:
    folder = tmp_path / "library"
    folder.mkdir()
    for name in ("flat.yaml", "flat.pgm", "flat.geojson", "half.yaml", "drive_1.mcap", "drive_2.mcap.part"):
        (folder / name).write_text(name)
    (tmp_path / "secret.mcap").write_text("secret")
    (folder / "robot.toml").write_text("token")
    app = FastAPI()
    add_library(app, Robot(folder), folder)
    return Client(app)


def test_it_lists_whole_maps_and_finished_recordings(client: Client) -> None:
    content = client.get("/library").json()
    assert [row["name"] for row in content["maps"]] == ["flat"]  # the other has no image
    assert [row["name"] for row in content["recordings"]] == ["drive_1.mcap"]
    assert content["maps"][0]["MB"] == 0.0
    assert abs(content["maps"][0]["saved_s"] - time.time()) < 3600


def test_it_downloads_maps_and_recordings(client: Client) -> None:
    packed = zipfile.ZipFile(io.BytesIO(client.get("/library/maps/flat.zip").content))
    assert packed.namelist() == ["flat.yaml", "flat.pgm", "flat.geojson"]
    recording = client.get("/library/recordings/drive_1.mcap")
    assert recording.text == "drive_1.mcap"
    assert "attachment" in recording.headers["Content-Disposition"]


@pytest.mark.parametrize(
    "path",
    [
        "maps/none.zip",
        "maps/..%2Fflat.zip",
        "recordings/..%2Fsecret.mcap",
        "recordings/%2e%2e",
        "recordings/robot.toml",
        "recordings/drive_2.mcap.part",
        "recordings/.hidden.mcap",
        "maps/.zip",
    ],
)
def test_no_name_is_a_path(client: Client, path: str) -> None:
    answer = client.get(f"/library/{path}")
    assert answer.status_code in (400, 404)
    assert "secret" not in answer.text
    assert "token" not in answer.text


@pytest.fixture
def shelf(tmp_path: Path) -> Path:
    """A folder with a map and a recording."""
    (tmp_path / "flat.yaml").write_text("image: flat.pgm\nresolution: 0.05\n")
    for name in ("flat.pgm", "flat.session", "flat.geojson", "drive.mcap", "flatter.yaml"):
        (tmp_path / name).write_text(name)
    return tmp_path


def test_a_map_is_renamed_with_all_its_files(shelf: Path) -> None:
    rename_item(shelf, "flat", "attic.2")
    kept = {"attic.2.yaml", "attic.2.pgm", "attic.2.session", "attic.2.geojson", "drive.mcap", "flatter.yaml"}
    assert {path.name for path in shelf.iterdir()} == kept
    assert (shelf / "attic.2.yaml").read_text() == "image: attic.2.pgm\nresolution: 0.05\n"
    assert (shelf / "attic.2.session").read_text() == "flat.session"


def test_a_recording_is_renamed_and_deleted(shelf: Path) -> None:
    rename_item(shelf, "drive.mcap", "kitchen.mcap")
    assert (shelf / "kitchen.mcap").read_text() == "drive.mcap"
    delete_item(shelf, "kitchen.mcap")
    delete_item(shelf, "flat")
    assert [path.name for path in shelf.iterdir()] == ["flatter.yaml"]


@pytest.mark.parametrize("name", ["../flat", "..", ".hidden.mcap", "a/b", "none", "", "flat\n", "flat\0"])
def test_no_other_file_is_deleted_or_renamed(shelf: Path, name: str) -> None:
    before = {path: path.read_bytes() for path in shelf.iterdir()}
    (shelf.parent / "flat.yaml").write_text("outside")
    with pytest.raises(ThumperError):
        delete_item(shelf, name)
    with pytest.raises(ThumperError):
        rename_item(shelf, name, "new")
    with pytest.raises(ThumperError):
        rename_item(shelf, "flat", name if name != "none" else "drive.mcap")
    (shelf / "taken.session").write_text("kept")
    with pytest.raises(ThumperError, match=r"taken\.session already"):
        rename_item(shelf, "flat", "taken")
    (shelf / "taken.session").unlink()
    assert {path: path.read_bytes() for path in shelf.iterdir()} == before
    assert (shelf.parent / "flat.yaml").read_text() == "outside"


def test_the_page_renames_and_deletes(page: Page, robot: FakeRobot) -> None:
    names = [{"name": name, "MB": 0.1, "saved_s": time.time()} for name in ("flat", "attic")]
    drives = [{"name": "drive_1.mcap", "MB": 1.0, "saved_s": time.time()}]
    page.route("**/library", lambda route: route.fulfill(json={"maps": names, "recordings": drives}))
    page.click(".tp-tab-map")
    page.click("[aria-label='Rename drive_1.mcap']")
    expect(page.locator("[aria-label='new name of drive_1.mcap']")).to_have_value("drive_1")
    page.keyboard.type("hall")
    page.keyboard.press("Enter")
    renamed = [{"name": "drive_1.mcap", "new_name": "hall.mcap"}]
    until(lambda: [ask.content for ask in queries_of(robot, "library/rename")] == renamed)
    page.click("[aria-label='Delete flat']")
    page.keyboard.press("Enter")  # keeps it: that button has the focus
    page.click("[aria-label='Delete attic']")
    page.click("[aria-label='Delete attic for good']")
    until(lambda: [ask.content for ask in queries_of(robot, "library/delete")] == [{"name": "attic"}])


def test_the_map_in_use_is_named_and_mapping_resumes(page: Page, robot: FakeRobot) -> None:
    maps = [{"name": name, "MB": 0.1, "saved_s": time.time()} for name in ("flat", "attic")]
    content: dict[str, Any] = {"maps": maps, "recordings": [], "in_use": ""}
    page.route("**/library", lambda route: route.fulfill(json=content))
    page.click(".tp-tab-map")
    rows = page.locator(".tp-library [data-list=maps] li")
    expect(rows.get_by_role("button", name="Load the map")).to_have_count(2)
    content["in_use"] = "flat"
    robot.event("loaded map 'flat'; the robot searches it for its pose")
    expect(rows.first).to_contain_text("in use")
    expect(rows.last).not_to_contain_text("in use")
    robot.localization = "localized"
    expect(page.locator(".tp-localization")).to_contain_text("localized")
    page.click("[aria-label='Resume mapping in the map flat']")
    until(lambda: {"command": "map_on"} in [query.content for query in queries_of(robot, "command")])
    content["in_use"] = ""
    robot.localization = "mapping"
    expect(rows.get_by_role("button", name="Load the map")).to_have_count(2)


def test_the_map_in_use_is_one_of_the_library(tmp_path: Path) -> None:
    mapper = object.__new__(SlamModeSwitch)
    mapper.localizer = None
    assert map_in_use(tmp_path / "flat.yaml", tmp_path, mapper) == ""  # it maps
    mapper.localizer = cast("Amcl", object())
    assert map_in_use(tmp_path / "flat.yaml", tmp_path, mapper) == "flat"
    assert map_in_use(tmp_path / "other" / "flat.yaml", tmp_path, mapper) == ""
    assert map_in_use(None, tmp_path, mapper) == ""


def test_the_page_saves_and_loads_maps(page: Page, robot: FakeRobot) -> None:
    content = {
        "maps": [{"name": "flat", "MB": 0.4, "saved_s": time.time() - 7300}],
        "recordings": [{"name": "drive_1.mcap", "MB": 120.5, "saved_s": time.time() - 100}],
    }

    def answer(route: Route) -> None:
        route.fulfill(json=content)

    page.route("**/library", answer)
    page.click(".tp-tab-map")
    expect(page.locator(".tp-library [data-list=maps] li")).to_contain_text("flat0.4 MB, 2 h ago")
    expect(page.locator(".tp-library [data-list=recordings] li")).to_contain_text("1.mcap120.5 MB, 1 min ago")
    page.locator(".tp-library input").fill("attic")
    content["maps"].insert(0, {"name": "attic", "MB": 0.1, "saved_s": time.time()})
    page.keyboard.press("Enter")
    until(lambda: [ask.content for ask in queries_of(robot, "library/save")] == [{"name": "attic"}])
    robot.event("map saved: attic.pgm")
    expect(page.locator(".tp-notice.good").last).to_have_text("map saved: attic.pgm")
    expect(page.locator(".tp-library [data-list=maps] li")).to_have_count(2)
    expect(page.locator(".tp-library")).not_to_contain_text("REC is running")
    robot.recording = True
    expect(page.locator(".tp-library [data-list=recordings] li").last).to_contain_text("REC is running")
    page.click("[aria-label='Load the map flat']")
    until(lambda: [ask.content for ask in queries_of(robot, "library/load")] == [{"name": "flat"}])
    page.click("[aria-label='Download attic']")
    expect(page.locator(".tp-notice.bad")).to_contain_text("attic is not on this computer")
