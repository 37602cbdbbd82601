"""The demo, end to end: both missions with the real firmware, checked against ground truth."""

import io
import json
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from thumper.maps.map_server_io import load_map
from thumper.slam.saved_state import load_session
from thumper_hil.demo.results import FILES, print_next_steps

Run = Callable[..., subprocess.CompletedProcess[str]]

SEED = 7


def test_demo_reaches_both_goals_and_writes_its_results(thumper: Run, tmp_path: Path) -> None:
    summary, output = run_demo(thumper, tmp_path)
    assert [mission["name"] for mission in summary["missions"]] == ["straight", "box"]
    for mission in summary["missions"]:
        assert mission["reached"]
        assert mission["goal_error_m"] <= 0.15  # the thesis asked for 0.4
        assert mission["collisions"] == 0
        assert 5.0 < mission["time_s"] < 60.0
        assert 1.8 < mission["path_length_m"] < 4.0
        assert mission["map_vs_truth"]["wall_error_p95_m"] <= 0.10
        assert mission["map_vs_truth"]["known_area_m2"] > 8.0
    for error in summary["wheel_speed_error"].values():
        assert abs(error["mean_rad_s"]) <= 0.04
        assert error["std_rad_s"] <= 0.31
    assert summary["seed"] == SEED
    assert summary["sim_speed_x_real_time"] > 0.0

    grid = load_map(tmp_path / "map.yaml")
    assert (grid.cells == 100).sum() > 100
    session = load_session(tmp_path / "map.session", grid.resolution_m)
    np.testing.assert_array_equal(session.counts.grid(0.25).cells, grid.cells)
    assert session.map_from_base is not None
    for picture in ("missions.png", "speed_control.png"):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "table.md").read_text()
    for condition in ("thesis", "Preset nominal; simulated at ", "set-point"):
        assert condition in page
    worst_cm = 100 * max(mission["goal_error_m"] for mission in summary["missions"])
    assert f"within {worst_cm:.1f} cm of its goals; the thesis required 40 cm" in output
    assert "set-point" not in output
    assert str(tmp_path) in output.replace("\n", "")
    assert output.startswith("A simulated robot drives two missions")
    assert "recording to" not in output
    for name, _ in FILES:
        assert f"  {name} " in output
        for part in name.split(", "):
            assert any(tmp_path.glob(part.rstrip("/"))), part
    assert any((tmp_path / "recordings").glob("*.mcap"))


@pytest.mark.slow
def test_a_demo_repeats(thumper: Run, tmp_path: Path) -> None:
    first, second = (run_demo(thumper, tmp_path / name)[0] for name in ("first", "second"))
    del first["sim_speed_x_real_time"], second["sim_speed_x_real_time"]
    assert first == second


def run_demo(thumper: Run, folder: Path) -> tuple[dict[str, Any], str]:
    """Return the summary of a demo and its output."""
    done = thumper("demo", "--out", folder, "--seed", str(SEED))
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((folder / "summary.json").read_text()), done.stdout


@pytest.mark.slow
def test_the_next_steps_of_the_demo_work(tmp_path: Path) -> None:
    output = io.StringIO()
    print_next_steps(Console(file=output))
    commands = [shlex.split(line) for line in output.getvalue().splitlines() if " --" in line]
    assert [command[1] for command in commands] == ["demo", "explore", "tune"]
    for _, *arguments in commands[1:]:
        done = subprocess.run(
            [sys.executable, "-m", "thumper", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
