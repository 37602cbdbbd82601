"""Test which start poses are allowed, and the message for the others."""

from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from thumper_hil.bench import Bench
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.options import BenchOptions
from thumper_hil.world.house import house_mission
from thumper_hil.world.start_pose import invalid_start_reason
from thumper_hil.world.world import World

ROOM = """
[[wall]]
closed = true
points_m = [[0, 0], [8, 0], [8, 4], [4, 4], [4, 8], [0, 8]]
[[wall]]
closed = true
points_m = [[1, 1], [3, 1], [3, 3], [1, 3]]
[[wall]]
points_m = [[5, 2], [6, 2], [6, 3]]
[[box]]
x_m = 2.0
y_m = 6.0
length_m = 2.0
width_m = 2.0
"""
OPEN = """
[[wall]]
points_m = [[0, 0], [2, 0], [2, 2]]
[[circle]]
x_m = 5.0
y_m = 0.0
radius_m = 1.0
"""


@pytest.mark.parametrize(
    ("text", "x_m", "y_m", "words"),
    [
        (ROOM, 7.0, 1.0, ""),
        (ROOM, 3.5, 6.0, ""),
        (ROOM, 0.02, 1.0, "in an obstacle"),
        (ROOM, 2.0, 2.0, "inside a closed wall"),
        (ROOM, 2.0, 6.0, "inside a box"),
        (ROOM, 6.0, 6.0, "outside the room"),  # inside the bounding box, but behind the corner
        (ROOM, 50.0, 0.0, "outside the room"),
        (OPEN, 50.0, 0.0, ""),  # an open world has no outside
        (OPEN, 5.0, 0.0, "in an obstacle"),
        (OPEN, 1.0, 1.0, ""),
    ],
)
def test_start_pose_is_free_or_the_reason_is_given(
    tmp_path: Path, text: str, x_m: float, y_m: float, words: str
) -> None:
    path = tmp_path / "world.toml"
    path.write_text(text)
    why = invalid_start_reason(World.load(path), Pose2(x_m=x_m, y_m=y_m), FOOTPRINT_M)
    assert words in why
    assert bool(words) == bool(why)


def test_start_outside_the_map_is_refused(tmp_path: Path) -> None:
    cells = np.full((60, 80), FREE, np.int8)
    cells[20:40, 50:70] = OCCUPIED
    save_map(
        OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0), tmp_path / "map.yaml"
    )
    world = World.load(tmp_path / "map.yaml")
    assert invalid_start_reason(world, Pose2(x_m=1.0, y_m=1.5), FOOTPRINT_M) == ""
    assert "in an obstacle" in invalid_start_reason(world, Pose2(x_m=3.0, y_m=1.5), FOOTPRINT_M)
    assert "outside the map" in invalid_start_reason(world, Pose2(x_m=-3.0, y_m=1.5), FOOTPRINT_M)


@pytest.mark.parametrize(("x_m", "words"), [(50.0, "outside the room of lab"), (2.82, "of lab")])
def test_bench_reports_an_invalid_start_in_one_line(x_m: float, words: str) -> None:
    with pytest.raises(ThumperError, match=words) as caught:
        Bench(BenchOptions(world="lab", x_m=x_m, y_m=1.6))
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_robot_in_a_house_starts_where_its_mission_does() -> None:
    start, of_mission = BenchOptions.parse({"world": "house-3"}).start, house_mission(3).start
    assert (start.x_m, start.y_m) == (of_mission.x_m, of_mission.y_m)
    assert start.theta_rad == pytest.approx(of_mission.theta_rad)
    assert BenchOptions.parse({"world": "house-3", "x_m": "1"}).start == Pose2(x_m=1.0)
    assert BenchOptions.parse({"world": "hall"}).start == Pose2()
