"""`--session`: mapping continues in the map of another run, from any pose."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.e2e.test_bad_input import refused
from thumper.common.geometry import Pose2
from thumper.maps.map_server_io import load_map, save_map
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid
from thumper.slam.saved_state import load_session

Run = Callable[..., subprocess.CompletedProcess[str]]
LIDAR = ("--lidar", "sim://robot/lidar")


def board(x_m: float, y_m: float, yaw_deg: float) -> tuple[str, str]:
    return "--board", f"sim://robot/board?world=lab&x_m={x_m}&y_m={y_m}&yaw_deg={yaw_deg}"


@pytest.mark.slow
def test_a_run_continues_the_session_of_another(thumper: Run, tmp_path: Path) -> None:
    first, second = (tmp_path / name for name in ("first", "second"))
    begun = (*board(0.0, 0.0, 0.0), *LIDAR, "--start", "0", "0", "0")
    done = thumper("run", *begun, "--goal", "1.0", "0.5", "--out", first)
    assert done.returncode == 0, done.stderr
    assert "map.yaml, map.session, map.png" in done.stdout
    session = first / "map.session"
    before = session.read_bytes()
    done = thumper(
        "run", *board(1.2, 0.4, 140.0), *LIDAR, "--session", session, "--goal", "-0.5", "0.3", "--out", second
    )
    assert done.returncode == 0, done.stderr
    assert f"{session}: saved with the robot at " in done.stdout
    assert session.read_bytes() == before
    old, new = (load_map(folder / "map.yaml") for folder in (first, second))
    assert np.count_nonzero(new.cells >= 0) > np.count_nonzero(old.cells >= 0)
    walls = [
        new.cell_of(*old.centre_of(int(row), int(col))) for row, col in np.argwhere(old.cells == OCCUPIED)
    ]
    near = [(new.cells[r - 1 : r + 2, c - 1 : c + 2] == OCCUPIED).any() for r, c in walls]
    assert np.mean(near) > 0.95  # still the same map
    pose = json.loads((second / "summary.json").read_text())["pose"]
    assert load_session(second / "map.session", 0.05).map_from_base == Pose2(**pose)


def test_a_new_run_keeps_the_map_of_an_earlier_one(thumper: Run, tmp_path: Path) -> None:
    earlier = OccupancyGrid(
        cells=np.full((2, 3), OCCUPIED, np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0
    )
    save_map(earlier, tmp_path / "map.yaml")
    done = thumper("run", *board(0.0, 0.0, 0.0), *LIDAR, "--goal", "0.3", "0", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"the map of an earlier run is kept as {tmp_path}/map_1.yaml" in done.stdout
    assert load_map(tmp_path / "map_1.yaml").cells.shape == (2, 3)
    assert load_map(tmp_path / "map.yaml").cells.size > earlier.cells.size


def test_invalid_sessions_overwrite_nothing(thumper: Run, tmp_path: Path) -> None:
    session = tmp_path / "map.session"
    session.write_bytes(b'{"thumper_session": 3}\n')
    commands = (("run", *board(0.0, 0.0, 0.0), *LIDAR, "--goal", "1", "0"), ("map-log", session))
    for command in commands:
        done = thumper(*command, "--session", session, "--out", tmp_path)
        refused(done, str(session), "version 3")
        assert done.returncode == 2
    assert [path.name for path in tmp_path.iterdir()] == ["map.session"]
    refused(thumper(*commands[0], "--session", session, "--map", session, "--out", tmp_path), "pass only one")
    done = thumper(*commands[1], "--session", session, "--method", "rbpf", "--out", tmp_path)
    refused(done, "scan_match")
