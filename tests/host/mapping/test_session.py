"""Maps that are saved, gone on with, cropped and turned."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.host.mapping.rooms import room_scan
from thumper.errors import ThumperError
from thumper.geometry import Pose2, Twist2
from thumper.mapping.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.mapping.grid_mapper import GridMapper, GridMapperOptions
from thumper.mapping.map_edit import cropped, rotated
from thumper.mapping.session import load_session, save_session


def mapped() -> GridMapper:
    mapper = GridMapper()
    for x_m in (0.0, 0.2, 0.4):
        mapper.update(Pose2(x_m=x_m), room_scan(Pose2(x_m=x_m)), Twist2())
    return mapper


def test_a_session_goes_on_where_it_stopped(tmp_path: Path) -> None:
    mapper = mapped()
    save_session(mapper, tmp_path / "room.session")
    again = load_session(tmp_path / "room.session")
    assert again.map_from_base == mapper.map_from_base
    np.testing.assert_array_equal(again.grid().cells, mapper.grid().cells)
    np.testing.assert_allclose(again.cells.distance_m, mapper.cells.distance_m, atol=1e-6)
    pose = Pose2(x_m=0.6, y_m=0.05, theta_rad=0.1)
    # The wheels start at zero again: odometry's origin is wherever the program was started.
    again.update(Pose2(), room_scan(mapper.map_from_base), Twist2())
    update = again.update(mapper.map_from_base.inverse() @ pose, room_scan(pose), Twist2())
    assert update.map_from_base.distance_m(pose) < 0.05  # a cell
    assert update.match_score > 0.9
    assert again.cells.hits.sum() > mapper.cells.hits.sum()


@pytest.mark.parametrize(
    ("harm", "word"),
    [
        (lambda data: data[:-10], "checksum"),
        (lambda data: data[:-1] + bytes([data[-1] ^ 1]), "checksum"),
        (lambda data: data.replace(b'"pose": [', b'"pose": [1'), "checksum"),
        (lambda data: data.replace(b'"first_cell": [-', b'"first_cell": ['), "checksum"),
        (lambda data: data.replace(b'"thumper_session": 2', b'"thumper_session": 9'), "version 9"),
        (lambda data: b"hello", "not a mapping session"),
        (lambda data: json.dumps({"thumper_session": 2}).encode() + b"\n", "not a mapping session"),
    ],
)
def test_a_damaged_session_is_refused(tmp_path: Path, harm: object, word: str) -> None:
    path = tmp_path / "room.session"
    save_session(mapped(), path)
    assert callable(harm)
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(ThumperError, match=word):
        load_session(path)


def test_another_resolution_is_refused(tmp_path: Path) -> None:
    save_session(mapped(), tmp_path / "a")
    with pytest.raises(ThumperError, match=r"resolution_m = 0\.05"):
        load_session(tmp_path / "a", GridMapperOptions(resolution_m=0.1))


def corner_map() -> OccupancyGrid:
    cells = np.full((40, 60), UNKNOWN, dtype=np.int8)
    cells[10:20, 20:30] = FREE
    cells[10, 20] = OCCUPIED
    return OccupancyGrid(cells=cells, resolution_m=0.1, origin_x_m=-1.0, origin_y_m=-2.0)


def test_cropping_keeps_every_known_cell_in_place() -> None:
    grid = corner_map()
    small = cropped(grid, margin_m=0.2)
    assert small.cells.shape == (14, 14)
    assert small.cells[small.cell_of(*grid.centre_of(10, 20))] == OCCUPIED
    assert np.count_nonzero(small.cells == FREE) == 99


def test_four_quarter_turns_change_nothing() -> None:
    grid = corner_map()
    turned = rotated(grid, math.pi / 2)
    x_m, y_m = grid.centre_of(10, 20)
    assert turned.cells[turned.cell_of(-y_m, x_m)] == OCCUPIED
    for _ in range(3):
        turned = rotated(turned, math.pi / 2)
    np.testing.assert_array_equal(turned.cells, grid.cells)
    assert (turned.origin_x_m, turned.origin_y_m) == pytest.approx((-1.0, -2.0))
