"""The map is saved in a thread, whole, one save at a time, and the outcome is reported."""

import threading
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.annotations import Annotations
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import load_map, save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.runtime.service import map_saver
from thumper.runtime.service.map_saver import MapSaver
from thumper.slam.saved_state import SavedSlamState, load_session

GRID = OccupancyGrid(cells=np.zeros((4, 5), dtype=np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
SESSION = SavedSlamState(counts=HitCounts.from_grid(GRID), map_from_base=Pose2(x_m=0.1))


def test_saving_does_not_wait_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk, reported = threading.Event(), threading.Event()
    reports: list[tuple[str, bool]] = []

    def slow(grid: OccupancyGrid, path: Path, _datum: object = None) -> Path:
        assert disk.wait(20.0)
        return save_map(grid, path)

    def report(text: str, good: bool) -> None:
        reports.append((text, good))
        reported.set()

    monkeypatch.setattr(map_saver, "save_map", slow)
    saver = MapSaver(lambda: GRID, lambda: SESSION, Annotations, tmp_path / "map.yaml", report)
    assert "saving the map" in saver()
    with pytest.raises(ThumperError, match="already"):
        saver()
    assert not reports
    disk.set()
    assert reported.wait(20.0)
    assert reports == [(f"map saved: {tmp_path / 'map.pgm'}, map.yaml, map.session", True)]
    assert load_session(tmp_path / "map.session", 0.05).map_from_base == SESSION.map_from_base
    assert load_map(tmp_path / "map.yaml").cells.shape == (4, 5)


def test_an_unwritable_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    reports: list[tuple[str, bool]] = []
    reported = threading.Event()

    def report(text: str, good: bool) -> None:
        reports.append((text, good))
        reported.set()

    MapSaver(lambda: GRID, lambda: SESSION, Annotations, tmp_path / "file" / "map.yaml", report)()
    assert reported.wait(20.0)
    assert reports[0][0].startswith("the map was not saved")
    assert not reports[0][1]


@pytest.mark.parametrize(("name", "called"), [("map.yaml", 1), ("flat.yaml", 0)])
def test_the_map_of_the_run_is_set_aside_before_it_is_replaced(
    tmp_path: Path, name: str, called: int
) -> None:
    reported, calls = threading.Event(), []

    def before_save() -> None:
        calls.append((tmp_path / "map.yaml").exists())

    saver = MapSaver(
        lambda: GRID,
        lambda: SESSION,
        Annotations,
        tmp_path / "map.yaml",
        lambda _text, _ok: reported.set(),
        before_save=before_save,
    )
    saver.save_to(tmp_path / name)
    assert reported.wait(20.0)
    assert calls == [False] * called
