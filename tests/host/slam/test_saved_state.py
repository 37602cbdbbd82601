"""Maps that are saved, to resume mapping later."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.distances import distance_from_scratch
from benchmarks.shared.rooms import ROOM, room_scan
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.maps.hit_counts import MAX_OBSERVATIONS, HitCounts
from thumper.maps.occupancy_grid import UNKNOWN
from thumper.offline.map_log import map_log
from thumper.slam.factory import MappingOptions, Method, PathMapper, make_mapper
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.saved_state import SavedSlamState, load_session, save_session

SIZE_M = 0.05
METHODS: tuple[Method, ...] = ("slam", "scan_match", "rbpf")


def mapped(method: Method = "scan_match", walls: FloatArray = ROOM) -> PathMapper:
    mapper = make_mapper(MappingOptions(method=method))
    for x_m in (0.0, 0.2, 0.4):
        mapper.update(Pose2(x_m=x_m), room_scan(Pose2(x_m=x_m), walls=walls), Twist2())
    return mapper


def saved(path: Path, mapper: PathMapper) -> Path:
    return save_session(
        SavedSlamState(counts=mapper.counts(), map_from_base=Pose2(x_m=0.4, theta_rad=0.1)), path
    )


@pytest.mark.parametrize("method", METHODS)
def test_session_holds_the_map_of_each_method(tmp_path: Path, method: Method) -> None:
    mapper = mapped(method)
    session = load_session(saved(tmp_path / "room.session", mapper), SIZE_M)
    assert session.map_from_base == Pose2(x_m=0.4, theta_rad=0.1)
    grid, again = mapper.grid(), session.counts.grid(0.25)
    row, col = again.cell_of(grid.origin_x_m + 0.01, grid.origin_y_m + 0.01)
    rows, cols = grid.cells.shape
    np.testing.assert_array_equal(again.cells[row : row + rows, col : col + cols], grid.cells)
    assert np.count_nonzero(again.cells != UNKNOWN) == np.count_nonzero(grid.cells != UNKNOWN)
    assert session.counts.hits.max() == 3  # scans


def test_session_of_a_lost_robot_has_no_pose(tmp_path: Path) -> None:
    path = save_session(
        SavedSlamState(counts=mapped().counts(), map_from_base=None), tmp_path / "room.session"
    )
    assert load_session(path, SIZE_M).map_from_base is None


@given(hits=st.integers(0, 60_000), misses=st.integers(0, 60_000))
def test_limited_observations_keep_the_state_of_a_cell(hits: int, misses: int) -> None:
    cell = (np.array([[n]], dtype=np.uint16) for n in (hits, misses))
    counts = HitCounts(hits=next(cell), misses=next(cell), first_cell=(0, 0), resolution_m=SIZE_M)
    aged = counts.limit_observations(0.25)
    assert int(aged.hits[0, 0]) + int(aged.misses[0, 0]) == min(hits + misses, MAX_OBSERVATIONS)
    assert aged.grid(0.25).cells == counts.grid(0.25).cells


def test_tightly_cropped_map_has_distances_behind_its_walls() -> None:
    mapper = mapped()
    assert isinstance(mapper, GridMapper)
    counts = mapper.counts()
    rows, cols = np.nonzero(counts.hits)
    low, high = (rows.min(), cols.min()), (rows.max() + 1, cols.max() + 1)
    box = np.s_[low[0] : high[0], low[1] : high[1]]
    first = (counts.first_cell[0] + int(low[0]), counts.first_cell[1] + int(low[1]))
    tight = HitCounts(hits=counts.hits[box], misses=counts.misses[box], first_cell=first, resolution_m=SIZE_M)
    grid = HitGrid.from_counts(tight, SIZE_M, 0.5, 0.25)
    np.testing.assert_allclose(grid.distance_m, distance_from_scratch(grid))
    inner, (x_m, y_m) = grid.distance_m, grid.corner_m
    row, col = round(y_m / SIZE_M) - counts.first_cell[0], round(x_m / SIZE_M) - counts.first_cell[1]
    whole = mapper.hit_grid.distance_m[row : row + inner.shape[0], col : col + inner.shape[1]]
    np.testing.assert_allclose(inner, whole, atol=1e-6)


def test_map_does_not_grow_with_each_restart() -> None:
    mapper = mapped()
    assert isinstance(mapper, GridMapper)
    first = again = HitGrid.from_counts(mapper.counts(), SIZE_M, 0.5, 0.25)
    for _ in range(3):
        again = HitGrid.from_counts(again.counts(), SIZE_M, 0.5, 0.25)
    assert again.corner_m == first.corner_m
    np.testing.assert_array_equal(again.hits, first.hits)
    np.testing.assert_allclose(again.distance_m, distance_from_scratch(again))


@pytest.mark.parametrize("shape", [(40, 30), (0, 0)])
def test_empty_map_stays_empty(shape: tuple[int, int]) -> None:
    empty = np.zeros(shape, dtype=np.uint8)
    counts = HitCounts(hits=empty, misses=empty, first_cell=(-5, -5), resolution_m=SIZE_M)
    assert not HitGrid.from_counts(counts, SIZE_M, 0.5, 0.25).occupied().any()


@pytest.mark.parametrize(
    ("harm", "word"),
    [
        (lambda data: data[:-10], "checksum"),
        (lambda data: data[:-1] + bytes([data[-1] ^ 1]), "checksum"),
        (lambda data: data.replace(b'"pose": [', b'"pose": [1'), "checksum"),
        (lambda data: data.replace(b'"first_cell": [-', b'"first_cell": ['), "checksum"),
        (lambda data: data.replace(b'"thumper_session": 2', b'"thumper_session": 9'), "version 9"),
        (lambda data: b"hello", "not a mapping session"),
        (lambda data: b"image: map.pgm\nresolution: 0.05\n", "not a mapping session.*--map"),
        (lambda data: b"[1]\n", "not a mapping session"),
        (lambda data: json.dumps({"thumper_session": 2}).encode() + b"\n", "not a mapping session"),
    ],
)
def test_damaged_session_is_refused(tmp_path: Path, harm: object, word: str) -> None:
    path = saved(tmp_path / "room.session", mapped())
    assert callable(harm)
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(ThumperError, match=word):
        load_session(path, SIZE_M)


def test_other_resolution_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match=r"resolution_m = 0\.05"):
        load_session(saved(tmp_path / "a", mapped()), 0.1)


def test_log_of_a_stationary_robot_is_refused(tmp_path: Path) -> None:
    session = load_session(saved(tmp_path / "room.session", mapped()), SIZE_M)
    scan = room_scan(Pose2(x_m=0.1), beams=180, first_rad=-math.pi / 2, step_rad=math.pi / 180)
    ranges = " ".join(f"{range_m:.3f}" for range_m in scan.ranges_m)
    log = tmp_path / "still.clf"
    log.write_text(
        "".join(f"FLASER 180 {ranges} 0 0 0 0 0 0 {k}.0 nohost {k}.0\n" for k in range(1, 5)),
        encoding="utf-8",
    )
    with pytest.raises(ThumperError, match="the log is localized, but the robot moves less than 1 m"):
        map_log(log, tmp_path / "out", session=session)


def test_log_of_another_place_does_not_change_the_session(tmp_path: Path) -> None:
    """Forty scans of a smaller room, then a path of 1.5 m in the known one."""
    path = saved(tmp_path / "map.session", mapped())
    before = path.read_bytes()
    lines = []
    for k in range(56):
        x_m = max(0.0, 0.1 * (k - 40))
        at, walls = Pose2(x_m=x_m), ROOM if k >= 40 else 0.6 * ROOM
        scan = room_scan(at, walls=walls, beams=180, first_rad=-math.pi / 2, step_rad=math.pi / 180)
        ranges = " ".join(f"{range_m:.3f}" for range_m in scan.ranges_m)
        lines.append(f"FLASER 180 {ranges} {x_m} 0 0 {x_m} 0 0 {k + 1}.0 nohost {k + 1}.0\n")
    (tmp_path / "elsewhere.clf").write_text("".join(lines), encoding="utf-8")
    with pytest.raises(ThumperError, match=r"lost at \d+ of 56 scans, so nothing is written"):
        map_log(tmp_path / "elsewhere.clf", tmp_path, session=load_session(path, SIZE_M))
    assert path.read_bytes() == before
    assert not (tmp_path / "map.yaml").exists()
