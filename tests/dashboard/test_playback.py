"""Playback: what the page shows of a recording, and how it comes back to the robot."""

import json
import struct
import time
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from benchmarks.shared.recorded_run import RUN, cycles
from fastapi import FastAPI
from playwright.sync_api import Page, Route, expect

from tests.dashboard.test_library import Client
from tests.dashboard.test_page_driving import TO_SCREEN, queries_of
from thumper.dashboard.playback import BURST, add_playback, part_of
from thumper.recording.recorder import Recorder

DURATION_S = 9.9  # 100 cycles of 0.1 s: the robot drives along x, 0.01 m in each
POSE = "document.querySelector('.tp-map').mapView.pose"


def record(folder: Path) -> Path:
    recorder = Recorder(folder, RUN)
    for topic, now_s, message in cycles(100):
        recorder(topic, now_s, message)
    recorder.close()
    (path,) = recorder.files
    return path


def heads(packets: bytes) -> list[dict[str, Any]]:
    found = []
    while packets:
        (size,) = struct.unpack_from("<I", packets)
        (length,) = struct.unpack_from("<I", packets, 4)
        found.append(json.loads(packets[8 : 8 + length]))
        packets = packets[4 + size :]
    return found


def test_a_part_starts_with_the_state_at_its_start(tmp_path: Path) -> None:
    first, *others = heads(b"".join(part_of(record(tmp_path), 5.0, 2.0)))
    assert (first["playback_s"], first["duration_s"]) == (5.0, pytest.approx(DURATION_S))
    assert first["pose"][:2] == [pytest.approx(0.49), 0.0]
    assert {"map", "status", "plan"} <= {*first, *first["arrays"]}
    assert first["trail"][::2] == pytest.approx([0.01 * k for k in range(50)])
    times_s = [head["playback_s"] for head in others]
    assert times_s == pytest.approx([5.0 + 0.1 * k for k in range(1, 21)])
    x_m = [head["pose"][0] for head in others]
    assert x_m == pytest.approx([0.5 + 0.01 * k for k in range(20)])  # each in the packet after its time
    assert sum(len(head["wheels"]) for head in others) == 20


def test_a_part_beyond_the_end_is_the_last_state(tmp_path: Path) -> None:
    *_, last = heads(b"".join(part_of(record(tmp_path), 500.0, 2.0)))
    assert last["playback_s"] == pytest.approx(DURATION_S)


def test_requests_for_parts_are_checked_and_limited(tmp_path: Path) -> None:
    folder = tmp_path / "library"
    folder.mkdir()
    name = record(folder).name
    (tmp_path / "secret.mcap").write_bytes((folder / name).read_bytes())
    (folder / "bad.mcap").write_bytes((folder / name).read_bytes()[:-5000])
    app = FastAPI()
    add_playback(app, folder)
    client = Client(app)
    assert client.get("/library/recordings/..%2Fsecret.mcap/packets").status_code in (400, 404)
    assert client.get("/library/recordings/bad.mcap/packets").status_code == 422
    for wrong in ("start_s=-1", "start_s=nan", "seconds=0", "seconds=1000"):
        assert client.get(f"/library/recordings/{name}/packets?{wrong}").status_code == 422
    assert client.get(f"/library/recordings/{name}/packets?seconds=1").status_code == 200
    refused = [client.get("/library/recordings/bad.mcap/packets").status_code for _ in range(3 * BURST)]
    assert 429 in refused


def open_playback(page: Page, library: Path) -> str:
    path = next(iter(library.glob("mole*.mcap")), None) or record(library)

    def answer(route: Route) -> None:
        route.fulfill(
            json={"maps": [], "recordings": [{"name": path.name, "MB": 0.1, "saved_s": time.time()}]}
        )

    page.route("**/library", answer)
    page.click(".tp-tab-map")
    page.click(f"[aria-label='Play {path.name}']")
    expect(page.locator("#tp-banner")).to_have_text(
        f"Playback of {path.name}: map and charts do not show the robot"
    )
    return path.name


def test_a_recording_plays_and_the_page_returns_to_the_robot(
    page: Page, robot: FakeRobot, library: Path
) -> None:
    robot.recording = True
    open_playback(page, library)
    page.wait_for_function(f"{POSE}?.[0] > 0.1 && {POSE}[1] === 0")  # the fake robot never is at y = 0
    page.wait_for_function("document.querySelector('.tp-map').mapView.grids.map.info.columns === 30")
    assert page.evaluate("document.querySelector('.tp-map').mapView.data.scan.length") > 100
    expect(page.locator("[data-field=mode]")).to_have_text("navigating")
    expect(page.locator(".tp-library")).to_contain_text("REC is running")  # of the robot, as REC shows
    page.click("[data-play]")
    expect(page.locator("[data-play]")).to_have_text("Play")
    page.keyboard.press("g")  # no goal on the map of a recording
    page.mouse.click(*page.evaluate(TO_SCREEN, [0.0, 0.0]))
    assert not page.locator("[data-tool=goal]").is_visible()
    page.locator(".tp-playback input").fill("8")
    page.wait_for_function(f"Math.abs({POSE}?.[0] - 0.79) < 0.001")
    assert page.evaluate("document.querySelector('.tp-map').mapView.data.trail.length") == 160
    page.locator(".tp-playback input").fill("2")
    page.wait_for_function(f"Math.abs({POSE}?.[0] - 0.19) < 0.001")
    page.select_option(".tp-playback select", "8")
    page.click("[data-play]")
    page.wait_for_function(f"{POSE}?.[0] > 0.975")  # the end
    expect(page.locator("[data-play]")).to_have_text("Play")
    page.keyboard.press("Escape")
    expect(page.locator("#tp-banner")).to_have_text("Simulated robot: Laboratory")
    expect(page.locator(".tp-playback")).to_be_hidden()
    page.wait_for_function(f"{POSE}?.[1] > 0.5")
    page.wait_for_function("document.querySelector('.tp-map').mapView.grids.map.info.columns === 100")
    expect(page.locator("[data-tool=goal]")).to_be_visible()
    assert robot.fault == 0
    assert not queries_of(robot, "mission/send")


def test_the_end_of_a_playback_finds_no_pose(page: Page, robot: FakeRobot, library: Path) -> None:
    robot.localization = "localized"
    chip = page.locator(".tp-header .tp-localization")
    expect(chip).to_contain_text("localized")
    page.locator(".tp-notice").evaluate_all("all => all.forEach((notice) => notice.remove())")
    open_playback(page, library)
    expect(chip).to_contain_text("mapping")
    expect(chip).to_have_css("background-color", "rgb(102, 57, 186)")  # of the recording, as the frame
    page.click("[data-end]")
    expect(chip).to_contain_text("localized")
    expect(chip).not_to_have_css("background-color", "rgb(102, 57, 186)")
    page.wait_for_timeout(300)
    expect(page.locator(".tp-notice")).to_have_count(0)


def test_any_command_ends_a_playback(page: Page, robot: FakeRobot, library: Path) -> None:
    open_playback(page, library)
    page.keyboard.press("Space")
    expect(page.locator("#tp-banner")).to_have_text("Simulated robot: Laboratory")
    until(lambda: robot.fault)
    expect(page.locator(".tp-fault")).to_be_visible()
