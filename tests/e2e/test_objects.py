"""A robot sees coloured boxes, places them on its map, and drives to one by its name.

The detector is a network that the test builds: it knows the colours and the shape of these boxes, no more.
The camera is rendered, the firmware is the real one.
"""

import importlib.util
import math
import re
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from tests.e2e.service import Service
from thumper.camera.detector import Detection
from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.common.geometry import Pose2
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.doctor.sensor_checks import check_sensors
from thumper.recording.reader import Recording
from thumper.recording.start_stop import recording_control
from thumper.ros.codec import Message
from thumper.ros.markers import objects_of
from thumper.runtime.assembly import open_robot
from thumper.runtime.object_finder import ObjectFinder
from thumper.runtime.object_map import ObjectMap
from thumper.runtime.sensor_table import CAMERA
from thumper_hil.bench import simulation

if not all(map(importlib.util.find_spec, ("cv2", "onnx", "onnxruntime"))):
    pytest.skip("the extra `objects` or onnx is not installed", allow_module_level=True)

from tests.host.camera.onnx_models import colour_detector

RED, GREEN = (200, 30, 40), (40, 160, 60)
OBJECTS_M = {"chair": (1.4, 0.45), "plant": (1.9, -0.5)}  # their sides towards the robot
WORLD = f"""
[[wall]]
points_m = [[-1.5, -2.0], [3.5, -2.0], [3.5, 2.0], [-1.5, 2.0]]
closed = true
[[box]]
name = "chair"
x_m = {OBJECTS_M["chair"][0] + 0.2}
y_m = {OBJECTS_M["chair"][1]}
length_m = 0.4
width_m = 0.4
colour = {list(RED)}
[[box]]
name = "plant"
x_m = {OBJECTS_M["plant"][0] + 0.15}
y_m = {OBJECTS_M["plant"][1]}
length_m = 0.3
width_m = 0.3
colour = {list(GREEN)}
height_m = 0.7
"""


def config(name: str, folder: Path) -> RobotConfig:
    folder.mkdir(exist_ok=True)
    (folder / "room.toml").write_text(WORLD)
    network = colour_detector(folder / "colours.onnx", {"chair": RED, "plant": GREEN, "cup": (0, 0, 255)})
    settings = RobotConfig(
        camera=CameraOptions(enabled=True, detector=str(network)),
        recording=RecordingOptions(folder=str(folder / "library")),
    )
    board = f"sim://{name}/board?world={folder / 'room.toml'}&x_m=0&y_m=0&yaw_deg=0"
    return with_ports(settings, board=board, lidar=f"sim://{name}/lidar")


@contextmanager
def robot(settings: RobotConfig, folder: Path) -> Iterator[Service]:
    name = settings.board.port.split("/")[2]
    with open_robot(settings, Pose2(), map_path=folder / "map.yaml") as loop:
        service = Service(loop, simulation(name))
        with patch("time.monotonic", service.wall_s):
            loop.wait_for_map()
            yield service


def objects_published(service: Service) -> list[list[tuple[str, float, float]]]:
    """Return a list that grows with each message of the topic `objects`."""
    published: list[list[tuple[str, float, float]]] = []

    def listen(topic: str, _stamp_s: float, message: Message) -> None:
        if topic == "objects":
            published.append(objects_of(message))

    service.robot.publisher.add_sink(listen)
    return published


def test_the_robot_drives_to_an_object_that_it_has_seen(tmp_path: Path) -> None:
    with robot(config("sees-objects", tmp_path), tmp_path) as service:
        published = objects_published(service)
        service.until(lambda: bool(published) and len(published[-1]) == 2, max_cycles=60)
        for label, x_m, y_m in published[-1]:
            assert math.dist((x_m, y_m), OBJECTS_M[label]) < 0.06, label
        refused = service.ask("mission/send", {"object": "cup"})
        assert refused["error"] == "no object 'cup' on this map; seen so far: chair, plant"
        ambiguous = service.ask("mission/send", {"object": "chair", "x_m": 1.0})
        assert "object and optionally" in ambiguous["error"]
        assert service.ask("mission/send", {"object": "chair", "tolerance_m": 0.05})["ok"]
        service.until(lambda: service.ask("mission/state")["state"] != "driving", max_cycles=300)
        assert service.ask("mission/state")["state"] == "reached"
        _, x_m, y_m, theta_rad = service.bench.truth()[-1, :4].tolist()
        ahead_m, left_m = (
            Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad).inverse().apply(np.array([OBJECTS_M["chair"]]))[0]
        )
        assert 0.4 < ahead_m < 0.65  # from the robot's centre, which is 0.21 m behind its front
        assert abs(math.atan2(left_m, ahead_m)) < 0.2
        assert service.bench.contacts == 0


def test_the_doctor_says_what_the_detector_finds(tmp_path: Path) -> None:
    settings = config("doctor-objects", tmp_path)
    *_, check = check_sensors(settings, seconds=0.5)
    assert (check.verdict, check.what) == ("pass", "detector: finds 3 kinds of object: chair, plant, cup")
    Path(settings.camera.detector).unlink()
    *_, check = check_sensors(settings, seconds=0.5)
    assert check.verdict == "fail"
    assert "colours.onnx: no such file; correct [camera] detector" in check.fix


def test_objects_are_in_the_status_and_in_the_recording(tmp_path: Path) -> None:
    settings = config("records-objects", tmp_path)
    with (
        robot(settings, tmp_path) as service,
        recording_control(service.robot, settings, Pose2(), tmp_path, print) as control,
    ):
        control.start()
        service.run_cycles(60)
        recorder = control.close()
    assert recorder is not None
    recorded = [(each.topic, each.decode()) for each in Recording((recorder.files[0],)).messages()]
    objects = [objects_of(message) for topic, message in recorded if topic == "objects"]
    assert sorted(label for label, _, _ in objects[-1]) == ["chair", "plant"]
    status = [message.sensors.splitlines() for topic, message in recorded if topic == "status"]
    assert status[0][-1] == "objects: none seen"
    assert re.fullmatch(r"objects: chair \(1\.4., 0\.4.\), plant \(1\.9., -0\.[45].\)", status[-1][-1])


def test_another_map_has_none_of_the_objects(tmp_path: Path) -> None:
    with robot(config("loads-another", tmp_path), tmp_path) as service:
        published = objects_published(service)
        service.until(lambda: bool(published) and len(published[-1]) == 2, max_cycles=60)
        service.ask("library/save", {"name": "room"})
        service.until((tmp_path / "library" / "room.yaml").exists, max_cycles=100)
        assert service.ask("library/load", {"name": "room"})["ok"]
        service.run_cycles(1)
        assert published[-1] == []


@pytest.mark.slow
def test_a_run_with_a_detector_repeats(tmp_path: Path) -> None:
    runs = []
    for run in range(2):
        with robot(config(f"repeats-{run}", tmp_path / str(run)), tmp_path) as service:
            published = objects_published(service)
            service.run_cycles(50)
            runs.append(published)
    assert runs[0] == runs[1]
    assert len(runs[0]) > 1


class SlowDetector:
    """Answers when the test says so, as a network on a slow computer does."""

    def __init__(self) -> None:
        self.frames: list[CameraFrame] = []
        self.results: list[Future[list[Detection]]] = []

    def find(self, frame: CameraFrame) -> Future[list[Detection]]:
        self.frames.append(frame)
        self.results.append(Future())
        return self.results[-1]


@contextmanager
def slow_robot(folder: Path) -> Iterator[tuple[Service, SlowDetector, ObjectMap]]:
    """Open a robot with a slow detector; it does not wait, as a real robot's does not."""
    settings = config(f"slow-{folder.name}", folder)
    with robot(settings, folder) as service:
        loop, slow, objects = service.robot, SlowDetector(), ObjectMap()
        (feed,) = (feed for feed in loop.inputs.feeds if feed.kind is CAMERA)
        loop.control_cycle.object_finder = ObjectFinder(
            slow.find,
            settings.camera,
            estimator=loop.inputs.estimator,
            publisher=loop.publisher,
            objects=objects,
            newest_frames=lambda: feed.samples,
            is_simulated=False,
        )
        yield service, slow, objects


CHAIR = Detection(label="chair", score=1.0, box_px=(280.0, 200.0, 360.0, 300.0))  # the wall ahead


def test_a_slow_detector_gets_the_newest_frame_and_delays_no_cycle(tmp_path: Path) -> None:
    with slow_robot(tmp_path) as (service, slow, objects):
        before_s = service.bench.time_s
        service.run_cycles(30)
        assert service.bench.time_s - before_s == pytest.approx(3.0, abs=0.2)  # no cycle has waited
        assert len(slow.frames) == 1
        for _ in range(3):
            slow.results[-1].set_result([CHAIR])
            service.run_cycles(2)
            assert slow.frames[-1].time_s > service.bench.time_s - 0.35  # not one that has waited
            service.run_cycles(10)
        assert len(slow.frames) == 4
        assert [(each.label, each.count) for each in objects.objects] == [("chair", 3)]
        assert objects.objects[0].seen_s == slow.frames[2].time_s


@pytest.mark.slow
def test_a_result_from_before_another_map_is_dropped(tmp_path: Path) -> None:
    with slow_robot(tmp_path) as (service, slow, objects):
        for _ in range(3):
            service.run_cycles(10)
            slow.results[-1].set_result([CHAIR])
        service.run_cycles(10)
        assert len(objects.objects) == 1
        objects.clear()
        slow.results[-1].set_result([CHAIR])
        service.run_cycles(2)
        for _ in range(2):
            slow.results[-1].set_result([CHAIR])
            service.run_cycles(10)
        assert not objects.objects  # the next two sightings are not enough


def test_a_detector_that_fails_is_reported_once(tmp_path: Path) -> None:
    with slow_robot(tmp_path) as (service, slow, _):
        service.run_cycles(10)
        slow.results[-1].set_exception(RuntimeError("out of memory"))
        service.run_cycles(30)
        assert len(slow.frames) == 1
        assert service.mode == "idle"
        assert [event for event in service.events if "detector" in event] == [
            "no more objects are found: the detector failed: out of memory"
        ]
