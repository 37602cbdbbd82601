"""The session of a run that crashed is resumed, or kept and named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thumper.cli.resume import (
    AUTOSAVE,
    INTERRUPTED,
    autosaved,
    keep_earlier_map,
    load_interrupted,
    set_aside_interrupted,
)
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import load_map, save_map
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import follow_waypoints
from thumper.runtime.drive.waypoints import Waypoints
from thumper.runtime.service import autosave
from thumper.slam.saved_state import SavedSlamState, save_session

COUNTS = HitCounts(
    hits=np.ones((2, 3), np.uint16),
    misses=np.zeros((2, 3), np.uint16),
    first_cell=(0, 0),
    resolution_m=RobotConfig().mapping.resolution_m,
)


def test_session_of_a_crash_is_loaded_with_its_pose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert load_interrupted(RobotConfig(), tmp_path, None) is None
    assert capsys.readouterr().out == ""
    save_session(SavedSlamState(counts=COUNTS, map_from_base=Pose2(x_m=1.0)), tmp_path / AUTOSAVE)
    session = load_interrupted(RobotConfig(), tmp_path, None)
    assert session is not None
    assert session.map_from_base == Pose2(x_m=1.0)
    assert np.array_equal(session.counts.hits, COUNTS.hits)
    output = capsys.readouterr().out
    assert "the last run did not end" in output
    assert "--fresh" in output
    assert "--start" not in output
    load_interrupted(RobotConfig(), tmp_path, Pose2())
    assert "--start is not used" in capsys.readouterr().out
    assert (tmp_path / AUTOSAVE).exists()  # another crash before the next save loses nothing


def test_session_without_walls_does_not_prevent_the_next_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = replace(COUNTS, hits=np.zeros((2, 3), np.uint16), misses=np.ones((2, 3), np.uint16))
    save_session(SavedSlamState(counts=empty, map_from_base=Pose2()), tmp_path / AUTOSAVE)
    assert load_interrupted(RobotConfig(), tmp_path, None) is None
    assert "no walls: starting a new map" in capsys.readouterr().out
    assert not (tmp_path / AUTOSAVE).exists()


def test_damaged_session_names_the_way_out(tmp_path: Path) -> None:
    (tmp_path / AUTOSAVE).write_text("no session")
    with pytest.raises(ThumperError, match="--fresh"):
        load_interrupted(RobotConfig(), tmp_path, None)


def test_the_next_run_does_not_overwrite_the_session_of_a_crash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    set_aside_interrupted(tmp_path)
    assert capsys.readouterr().out == ""
    (tmp_path / AUTOSAVE).write_text("map")
    set_aside_interrupted(tmp_path)
    assert (tmp_path / INTERRUPTED).read_text() == "map"
    assert not (tmp_path / AUTOSAVE).exists()
    assert f"--session {tmp_path / INTERRUPTED}" in capsys.readouterr().out


def test_ctrl_c_while_the_map_is_written_says_what_becomes_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(
        KeyboardInterrupt, match=f"not saved, but the next run with --out {tmp_path} resumes it"
    ):
        drive_to(0.3, tmp_path, monkeypatch, "ctrl_c", KeyboardInterrupt())
    assert (tmp_path / AUTOSAVE).exists()


def drive_to(
    x_m: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    end: BaseException | None = None,
) -> None:
    """Drive to a place, then fail."""
    monkeypatch.setattr(autosave, "PERIOD_S", 0.0)
    config = with_ports(RobotConfig(), board=f"sim://{name}/board?world=lab", lidar=f"sim://{name}/lidar")
    goals = Waypoints.at(Goal(x_m=x_m, y_m=0.0))
    with open_robot(config, Pose2()) as robot, autosaved(robot, tmp_path):
        robot.run(follow_waypoints(goals))
        raise end or ThumperError("failed")


def test_a_refused_goal_leaves_no_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ThumperError, match="choose a goal at most 50 m away"):
        drive_to(100.0, tmp_path, monkeypatch, "refused")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_after_a_refusal_keeps_the_session_of_a_crash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_session(SavedSlamState(counts=COUNTS, map_from_base=Pose2(x_m=1.0)), tmp_path / AUTOSAVE)
    with pytest.raises(ThumperError, match="choose a goal at most 50 m away"):
        drive_to(100.0, tmp_path, monkeypatch, "refused_again")
    assert (tmp_path / AUTOSAVE).exists()


def test_a_failure_after_a_drive_leaves_its_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ThumperError, match="failed"):
        drive_to(0.5, tmp_path, monkeypatch, "failed")
    assert (tmp_path / AUTOSAVE).exists()


@pytest.mark.parametrize("opened", [None, "other/map.session", INTERRUPTED])
def test_a_new_map_keeps_that_of_an_earlier_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], opened: str | None
) -> None:
    grid = COUNTS.grid(0.5)
    (tmp_path / "map_1.pgm").write_text("an image without a map")
    save_map(grid, tmp_path / "map.yaml")
    (tmp_path / "map.session").write_text("session")
    keep = keep_earlier_map(tmp_path, tmp_path / opened if opened else None)
    keep()
    names = ["map_1.pgm", "map_2.pgm", "map_2.session", "map_2.yaml"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert np.array_equal(load_map(tmp_path / "map_2.yaml").cells, grid.cells)
    (line,) = capsys.readouterr().out.splitlines()
    assert line == f"the map of an earlier run is kept as {tmp_path}/map_2.yaml"
    save_map(grid, tmp_path / "map.yaml")
    keep()  # the second time that this run saves its map
    assert (tmp_path / "map.yaml").exists()
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("opened", ["map.yaml", "map.session", AUTOSAVE])
def test_a_run_replaces_the_map_that_it_continues(tmp_path: Path, opened: str) -> None:
    save_map(COUNTS.grid(0.5), tmp_path / "map.yaml")
    keep_earlier_map(tmp_path, tmp_path / "." / opened)()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]
