"""Where a robot may stand when the world begins, and the one line that says why not elsewhere."""

from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from thumper_hil.bench import Bench
from thumper_hil.bench.collision import HULL_M
from thumper_hil.bench.options import BenchOptions
from thumper_hil.world.start_pose import why_not_here
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
        (ROOM, 6.0, 6.0, "outside the room"),  # within the outermost walls' square, behind the corner
        (ROOM, 50.0, 0.0, "outside the room"),
        (OPEN, 50.0, 0.0, ""),  # nothing there says where it ends
        (OPEN, 5.0, 0.0, "in an obstacle"),
        (OPEN, 1.0, 1.0, ""),
    ],
)
def test_a_start_is_free_or_told_why_not(
    tmp_path: Path, text: str, x_m: float, y_m: float, words: str
) -> None:
    path = tmp_path / "world.toml"
    path.write_text(text)
    why = why_not_here(World.load(path), Pose2(x_m=x_m, y_m=y_m), HULL_M)
    assert words in why
    assert bool(words) == bool(why)


def test_a_map_ends_at_its_edge(tmp_path: Path) -> None:
    cells = np.full((60, 80), FREE, np.int8)
    cells[20:40, 50:70] = OCCUPIED
    save_map(
        OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0), tmp_path / "map.yaml"
    )
    world = World.load(tmp_path / "map.yaml")
    assert why_not_here(world, Pose2(x_m=1.0, y_m=1.5), HULL_M) == ""
    assert "in an obstacle" in why_not_here(world, Pose2(x_m=3.0, y_m=1.5), HULL_M)
    assert "outside the map" in why_not_here(world, Pose2(x_m=-3.0, y_m=1.5), HULL_M)


@pytest.mark.parametrize(("x_m", "words"), [(50.0, "outside the room of lab"), (2.82, "of lab")])
def test_the_bench_refuses_in_one_line(x_m: float, words: str) -> None:
    with pytest.raises(ThumperError, match=words) as caught:
        Bench(BenchOptions(world="lab", x_m=x_m, y_m=1.6))
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
