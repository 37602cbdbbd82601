"""Test maps as worlds, timed obstacles and walking people."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.board.framing import encode_frame
from thumper.board.messages import Command, CommandRequest, SetMotorPwm
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.options import BenchOptions
from thumper_hil.world.occupancy import SolidGrid
from thumper_hil.world.scene import Scene
from thumper_hil.world.world import World

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).resolve().parents[4] / "shared" / "data"))
FAR_FOOTPRINT_M = FOOTPRINT_M + 50.0
NO_SEGMENTS, NO_CIRCLES = np.zeros((0, 4)), np.zeros((0, 3))


def grid_world(solid: np.ndarray, resolution_m: float = 0.1) -> World:
    grid = SolidGrid(solid=solid, resolution_m=resolution_m, x_lo_m=-1.0, y_lo_m=-2.0)
    return World(segments_m=NO_SEGMENTS, circles_m=NO_CIRCLES, grid=grid)


def squares(solid: np.ndarray, resolution_m: float = 0.1) -> World:
    """Return the same cells as boxes, which a different algorithm handles."""
    sides = []
    for row, column in np.argwhere(solid):
        x, y = -1.0 + column * resolution_m, -2.0 + row * resolution_m
        corners = np.array(
            [[x, y], [x + resolution_m, y], [x + resolution_m, y + resolution_m], [x, y + resolution_m]]
        )
        sides.append(np.column_stack([corners, np.roll(corners, -1, axis=0)]))
    return World(segments_m=np.vstack([NO_SEGMENTS, *sides]), circles_m=NO_CIRCLES)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_grid_rays_and_clearance_match_equivalent_boxes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid = rng.random((24, 30)) < 0.08
    origin = rng.uniform((-2.0, -3.0), (3.0, 1.5))
    column, row = np.floor((origin - (-1.0, -2.0)) / 0.1).astype(int)
    if 0 <= row < 24 and 0 <= column < 30:
        solid[row, column] = False
    angles = rng.uniform(-math.pi, math.pi, 100)
    on_grid = grid_world(solid).cast(origin[0], origin[1], angles)
    assert on_grid == pytest.approx(squares(solid).cast(origin[0], origin[1], angles), abs=1e-6)
    pose = Pose2(x_m=origin[0], y_m=origin[1], theta_rad=angles[0])
    expected = min(squares(solid).clearance_m(pose, FOOTPRINT_M), 0.5)
    assert grid_world(solid).clearance_m(pose, FOOTPRINT_M) == pytest.approx(expected, abs=1e-9)


def test_rays_along_the_axes_and_from_inside_a_cell() -> None:
    solid = np.zeros((20, 20), np.bool_)
    solid[:, 15] = True
    world = grid_world(solid)
    assert world.cast(0.0, -1.0, np.array([0.0, math.pi, math.pi / 2])) == pytest.approx(
        [0.5, math.inf, math.inf]
    )
    assert world.cast(0.55, -1.05, np.array([0.0, 1.0])) == pytest.approx([0.0, 0.0])
    assert world.cast(-3.0, -1.05, np.array([0.0])) == pytest.approx([3.5])


def test_map_file_round_trips_through_a_world(tmp_path: Path) -> None:
    cells = np.full((30, 40), FREE, np.int8)
    cells[5:8, 10:20] = OCCUPIED
    cells[20, 3] = OCCUPIED
    save_map(
        OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-1.0, origin_y_m=-0.5), tmp_path / "m.yaml"
    )
    (tmp_path / "with_box.toml").write_text(
        'map = "m.yaml"\n[[box]]\nx_m = 0.5\ny_m = 0.5\nlength_m = 0.2\nwidth_m = 0.2\n'
    )
    world = World.load(tmp_path / "m.yaml")
    again = world.to_grid(0.05)
    places = np.argwhere(again.cells == OCCUPIED) * 0.05 + (again.origin_y_m, again.origin_x_m)
    assert (
        np.round(places, 6).tolist()
        == np.round(np.argwhere(cells == OCCUPIED) * 0.05 + (-0.5, -1.0), 6).tolist()
    )
    assert World.load(tmp_path / "with_box.toml").cast(0.0, 0.5, 0.0) == pytest.approx([0.4])


@pytest.mark.skipif(not DATA.exists(), reason="no recorded data; set THUMPER_DATA")
def test_published_maps_load() -> None:
    maps = [path for path in sorted(DATA.glob("nav/**/*.yaml")) if "mode: scale" not in path.read_text()]
    assert len(maps) > 10
    for path in maps:
        world = World.load(path)
        assert world.grid is not None
        assert world.grid.solid.any()


TIMED = """
[[wall]]
points_m = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]]
closed = true
[[box]]
x_m = 2.0
y_m = 0.0
length_m = 0.2
width_m = 1.0
from_s = 1.0
until_s = 2.0
"""
PERSON = """
[[person]]
waypoints_m = [[1.0, -2.0], [1.0, 2.0]]
speed_m_s = 0.5
radius_m = 0.2
from_s = 0.5
"""


def test_timed_obstacles_appear_and_disappear(tmp_path: Path) -> None:
    (tmp_path / "w.toml").write_text(TIMED)
    scene = Scene(World.load(tmp_path / "w.toml"))
    ahead = []
    for time_s in (0.5, 1.5, 2.5):
        scene.step(time_s, 1.0, FAR_FOOTPRINT_M)
        ahead.append(float(scene.world.cast(0.0, 0.0, 0.0)[0]))
    assert ahead == pytest.approx([4.0, 1.9, 4.0])


def test_person_walks_back_and_forth(tmp_path: Path) -> None:
    """At 0.5 m/s from 0.5 s on, the person is at the far end after 8 s and back after 16 s."""
    (tmp_path / "w.toml").write_text(TIMED + PERSON)
    scene = Scene(World.load(tmp_path / "w.toml"))
    places = {}
    for tick in range(1, 1651):
        scene.step(tick * 0.01, 0.01, FAR_FOOTPRINT_M)
        places[tick] = scene.world.circles_m[-1]
    assert places[49] == pytest.approx([1.0, -2.0, 0.2])
    assert places[249] == pytest.approx([1.0, -1.0, 0.2], abs=0.02)
    assert places[849] == pytest.approx([1.0, 2.0, 0.2], abs=0.02)
    assert places[1649] == pytest.approx([1.0, -2.0, 0.2], abs=0.02)


def test_person_stops_at_the_robot_without_a_robot_contact(tmp_path: Path) -> None:
    (tmp_path / "w.toml").write_text(TIMED + PERSON)
    bench = Bench(BenchOptions(world=str(tmp_path / "w.toml"), x_m=1.0))
    bench.advance(8.0)
    assert (bench.touches_by_people, bench.contacts) == (1, 0)
    assert bench.world.circles_m[-1, 1] == pytest.approx(-0.2 - 0.15, abs=0.02)


def test_robot_contact_with_a_person_is_counted(tmp_path: Path) -> None:
    (tmp_path / "w.toml").write_text(TIMED + PERSON.replace("from_s = 0.5", "from_s = 99.0"))
    bench = Bench(BenchOptions(world=str(tmp_path / "w.toml"), x_m=0.2, y_m=-2.0))
    bench.advance(0.1)
    arm = CommandRequest(command=Command.ARM)
    bench.chip.send(encode_frame(arm.ID, 1, arm.pack()))
    for _ in range(25):
        bench.chip.send(encode_frame(SetMotorPwm.ID, 1, SetMotorPwm(left=120, right=120).pack()))
        bench.advance(bench.time_s + 0.1)
    assert (bench.touches_by_people, bench.contacts) == (0, 1)
    assert bench.truth()[-1, 1] == pytest.approx(0.8 - 0.21, abs=0.03)


def test_lidar_sees_moving_people(tmp_path: Path) -> None:
    """The person crosses the forward beam at 1 m after 4.5 s, within the radius."""
    (tmp_path / "w.toml").write_text(TIMED + PERSON)
    bench = Bench(BenchOptions(world=str(tmp_path / "w.toml"), x_m=-1.0))
    seen = {}
    for time_s in (2.5, 4.5):
        bench.advance(time_s)
        seen[time_s] = float(bench.world.cast(-0.88, 0.0, 0.0)[0])
    assert seen == pytest.approx({2.5: 4.88, 4.5: 1.68}, abs=0.01)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[person]]\nwaypoints_m = [[0, 0]]\n", "two or more points"),
        ("[[person]]\nwaypoints_m = [[0, 0], [0, 0]]\n", "are equal"),
        ("[[person]]\nwaypoints_m = [[0, 0], [1, 0]]\nspeed_m_s = 0\n", "above 0"),
        ("[[circle]]\nx_m=0\ny_m=0\nradius_m=1\nfrom_s=2\nuntil_s=1\n", "after from_s"),
        ('map = "nowhere.yaml"\n', "nowhere.yaml"),
    ],
)
def test_invalid_world_entries_are_reported(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "w.toml"
    path.write_text(text)
    with pytest.raises(ThumperError, match=words):
        World.load(path)
