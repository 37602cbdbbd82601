"""`thumper edit` writes a new map, reports it in one line and overwrites only with --force."""

import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.e2e.test_bad_input import refused
from thumper.common.geometry import Pose2
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import load_map, save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED
from thumper.slam.saved_state import SavedSlamState, load_session, save_session
from thumper_hil.world.world import World

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def thumper(in_process: Run) -> Run:
    """Run each command in this process: its files, messages and exit status are the same."""
    return in_process


def test_edits_a_map_into_a_new_one(thumper: Run, tmp_path: Path) -> None:
    lab, new = tmp_path / "lab.yaml", tmp_path / "sub" / "new.yaml"
    grid = World.load("lab").to_grid()
    save_map(grid, lab)
    free, wall = "-0.2,-0.2,0.2,0.2", "-0.38,-0.3,-0.38,0.3"
    done = thumper("edit", lab, "--free", free, "--wall", wall, "--crop", "-1,-1,1,1", "--out", new)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(
        f"{lab}: 1 box made free, 1 box made a wall, cropped; now 40 x 40 cells of 0.05 m"
    )
    assert done.stdout.count("\n") == 1
    made = load_map(new)
    assert made.cells[made.cell_of(0.0, 0.0)] == FREE
    assert made.cells[made.cell_of(-0.38, 0.1)] == OCCUPIED
    said = load_session(new.with_suffix(".session"), 0.05)
    np.testing.assert_array_equal(said.counts.grid(0.25).cells, made.cells)
    assert said.map_from_base is None
    before = new.read_bytes()
    refused(thumper("edit", lab, "--trim", "--out", new), str(new), "already exists")
    refused(thumper("edit", new, "--rotate", "90", "--out", new), "already exists")
    assert new.read_bytes() == before
    done = thumper("edit", new, "--rotate", "90", "--out", new, "--force")
    assert done.returncode == 0, done.stderr
    turned = load_map(new)
    np.testing.assert_array_equal(turned.cells, made.cells.T[:, ::-1])


def test_the_session_follows_the_edited_map(thumper: Run, tmp_path: Path) -> None:
    lab, new = tmp_path / "lab.yaml", tmp_path / "new.session"
    grid = World.load("lab").to_grid()
    save_map(grid, lab)
    was = Pose2(x_m=1.0, y_m=0.5, theta_rad=0.2)
    save_session(
        SavedSlamState(counts=HitCounts.from_grid(grid), map_from_base=was), lab.with_suffix(".session")
    )
    new.write_text("of another map")
    refused(thumper("edit", lab, "--rotate", "90", "--out", tmp_path / "new"), str(new), "already exists")
    assert [new.read_text(), (tmp_path / "new.yaml").exists()] == ["of another map", False]
    done = thumper("edit", lab, "--rotate", "90", "--out", lab, "--force")
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(": " + f"{lab}, lab.pgm, lab.session\n")
    said = load_session(lab.with_suffix(".session"), 0.05)
    turned = load_map(lab)
    np.testing.assert_array_equal(said.counts.grid(0.25).cells, turned.cells)
    assert said.counts.grid(0.25).origin_x_m == pytest.approx(turned.origin_x_m)
    assert said.map_from_base is not None
    assert said.map_from_base.x_m == pytest.approx(-0.5)
    assert said.map_from_base.y_m == pytest.approx(1.0)
    assert said.map_from_base.theta_rad == pytest.approx(0.2 + math.pi / 2)


def test_a_dot_in_the_name_stays(thumper: Run, tmp_path: Path) -> None:
    lab, new = tmp_path / "lab.yaml", tmp_path / "new"
    save_map(World.load("lab").to_grid(), lab)
    done = thumper("edit", lab, "--trim", "--out", new / "map.v2")
    assert done.returncode == 0, done.stderr
    assert {path.name for path in new.iterdir()} == {"map.v2.yaml", "map.v2.pgm", "map.v2.session"}
    load_map(new / "map.v2.yaml")


def test_invalid_edits(thumper: Run, tmp_path: Path) -> None:
    lab = tmp_path / "lab.yaml"
    save_map(World.load("lab").to_grid(), lab)
    for arguments, word in (
        ((lab,), "nothing to do"),
        ((lab, "--wall", "1,2,3"), "--wall 1,2,3: give X0,Y0,X1,Y1"),
        ((lab, "--free", "90,0,91,1"), "outside the map"),
        ((lab, "--crop", "0,0,1,1", "--trim"), "give one"),
        ((lab, "--trim", "--out", tmp_path), "is a directory; name the new map"),
        ((tmp_path / "none.yaml", "--trim"), "none.yaml"),
    ):
        out = () if "--out" in arguments else ("--out", tmp_path / "new.yaml")
        done = thumper("edit", *out, *arguments)
        refused(done, word)
        assert done.returncode == 2
    assert not (tmp_path / "new.yaml").exists()
