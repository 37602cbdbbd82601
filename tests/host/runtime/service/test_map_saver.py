"""Saving the map: in a thread, whole, one at a time, and what came of it is told."""

import threading
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import load_map, save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.runtime.service import map_saver
from thumper.runtime.service.map_saver import MapSaver
from thumper.slam.saved_state import SavedSlamState, load_session

GRID = OccupancyGrid(cells=np.zeros((4, 5), dtype=np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
SESSION = SavedSlamState(counts=HitCounts.from_grid(GRID), map_from_base=Pose2(x_m=0.1))


def test_the_caller_does_not_wait_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk, told = threading.Event(), threading.Event()
    said: list[tuple[str, bool]] = []

    def slow(grid: OccupancyGrid, path: Path) -> Path:
        assert disk.wait(20.0)
        return save_map(grid, path)

    def say(text: str, good: bool) -> None:
        said.append((text, good))
        told.set()

    monkeypatch.setattr(map_saver, "save_map", slow)
    saver = MapSaver(lambda: GRID, lambda: SESSION, tmp_path / "map.yaml", say)
    assert "saving the map" in saver()
    with pytest.raises(ThumperError, match="already"):
        saver()
    assert not said
    disk.set()
    assert told.wait(20.0)
    assert said == [(f"map saved: {tmp_path / 'map.pgm'}, map.yaml, map.session", True)]
    assert load_session(tmp_path / "map.session", 0.05).map_from_base == SESSION.map_from_base
    assert load_map(tmp_path / "map.yaml").cells.shape == (4, 5)


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    said: list[tuple[str, bool]] = []
    told = threading.Event()

    def say(text: str, good: bool) -> None:
        said.append((text, good))
        told.set()

    MapSaver(lambda: GRID, lambda: SESSION, tmp_path / "file" / "map.yaml", say)()
    assert told.wait(20.0)
    assert said[0][0].startswith("the map was not saved")
    assert not said[0][1]
