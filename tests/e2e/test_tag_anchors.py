"""Tags seen while mapping are saved with the map, and show a robot its start. The camera is rendered."""

import importlib.util
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from tests.e2e.service import Service
from tests.variants import some_of
from thumper.camera.options import CameraOptions
from thumper.common.geometry import Pose2, wrap_angle
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.maps.annotations import Annotations, SavedTag, load_annotations
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.runtime.assembly import open_robot
from thumper_hil.bench import simulation
from thumper_hil.world.world import World

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

START = Pose2(x_m=-0.6, y_m=0.12, theta_rad=math.radians(175.0))  # the tag is in view, 1 m away
TAG = SavedTag(number=0, x_m=-1.595, y_m=0.0, yaw_rad=0.0)


@contextmanager
def robot(
    name: str,
    folder: Path,
    start: Pose2 | None,
    known: OccupancyGrid | None,
    *tags: SavedTag,
    world: Path | str = "charging",
    true: Pose2 = START,
) -> Iterator[Service]:
    config = RobotConfig(
        camera=CameraOptions(enabled=True), recording=RecordingOptions(folder=str(folder / "library"))
    )
    mission = f"world={world}&x_m={true.x_m}&y_m={true.y_m}&yaw_deg={math.degrees(true.theta_rad)}"
    config = with_ports(config, board=f"sim://{name}/board?{mission}", lidar=f"sim://{name}/lidar")
    annotations = Annotations(tags=tags)
    with open_robot(config, start, known, map_path=folder / "map.yaml", annotations=annotations) as loop:
        service = Service(loop, simulation(name))
        with patch("time.monotonic", service.wall_s):
            loop.wait_for_map()
            yield service


def test_a_tag_in_view_is_surveyed_and_saved_with_the_map(tmp_path: Path) -> None:
    with robot("surveys", tmp_path, START, None) as service:
        service.until(lambda: any(event.startswith("tag 0 is at") for event in service.events), max_cycles=50)
        service.ask("library/save", {"name": "room"})
        saved = tmp_path / "library" / "room.geojson"
        service.until(saved.exists, max_cycles=100)
    (tag,) = load_annotations(saved).tags
    assert math.hypot(tag.x_m - TAG.x_m, tag.y_m - TAG.y_m) < 0.03
    assert abs(math.degrees(wrap_angle(tag.yaw_rad))) < 3.0


@pytest.mark.parametrize("room", some_of([1, 0]))
def test_a_known_tag_tells_in_which_of_two_equal_rooms_the_robot_is(room: int, tmp_path: Path) -> None:
    grid = World.load("charging").to_grid()
    width_m = grid.cells.shape[1] * grid.resolution_m
    rooms = replace(grid, cells=np.concatenate((grid.cells, grid.cells), axis=1))
    tag = replace(TAG, x_m=TAG.x_m + room * width_m)
    with robot(f"starts-in-{room}", tmp_path, None, rooms, tag) as service:
        service.until(
            lambda: any(event.startswith("pose by tag 0") for event in service.events), max_cycles=50
        )
        service.run_cycles(60)
        state = service.robot.inputs.estimator.state()
    assert state is not None
    assert not state.lost
    assert (
        math.hypot(state.map_from_base.x_m - START.x_m - room * width_m, state.map_from_base.y_m - START.y_m)
        < 0.1
    )
    assert abs(wrap_angle(state.map_from_base.theta_rad - START.theta_rad)) < 0.1


# Turned by 180 degrees it is the same room to the lidar.
SYMMETRIC = """
[[wall]]
points_m = [[-2.0, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.0, 1.5]]
closed = true
[[tag]]
id = 5
x_m = 1.995
y_m = 0.0
yaw_deg = 180.0
"""


@pytest.mark.slow
def test_a_tag_that_was_surveyed_corrects_the_pose_in_a_drive(tmp_path: Path) -> None:
    """The robot estimates the opposite heading. It drives away from its goal until it sees the tag."""
    world = tmp_path / "symmetric.toml"
    world.write_text(SYMMETRIC)
    near = Pose2(x_m=0.9, y_m=0.1)
    with robot("surveys-5", tmp_path, near, None, world=world, true=near) as service:
        service.until(lambda: any(event.startswith("tag 5 is at") for event in service.events), max_cycles=50)
        tags = service.robot.annotations.tags
    goal, true = (-1.2, 0.0), Pose2(x_m=-0.6, theta_rad=math.pi / 2.0)
    wrong = Pose2(theta_rad=math.pi) @ true
    grid = World.load(world).to_grid()
    with robot("drives-wrong", tmp_path, wrong, grid, *tags, world=world, true=true) as service:
        service.run_cycles(20)
        assert service.ask("mission/send", {"x_m": goal[0], "y_m": goal[1]})["ok"]
        farthest_m = 0.0
        while service.ask("mission/state")["state"] == "driving":
            farthest_m = max(farthest_m, math.dist(service.bench.truth()[-1, 1:3], goal))
        assert service.ask("mission/state")["state"] == "reached"
        at_m = service.bench.truth()[-1, 1:3]
    assert sum(event.startswith("pose by tag 5") for event in service.events) == 1
    assert farthest_m > 0.9  # it began in the wrong direction
    assert math.dist(at_m, goal) < 0.15
