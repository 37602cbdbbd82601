"""`thumper explore` with a robot that fails: it reports why and saves the map so far."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

Run = Callable[..., subprocess.CompletedProcess[str]]


def test_a_lost_lidar_ends_exploration_and_saves_the_map(thumper: Run, tmp_path: Path) -> None:
    (tmp_path / "faults.toml").write_text('faults = [{ at_s = 6.0, lidar = "unplugged" }]\n')
    board = f"sim://robot/board?world=lab&scenario={tmp_path / 'faults.toml'}"
    out = tmp_path / "out"
    done = thumper("explore", "--board", board, "--lidar", "sim://robot/lidar", "--out", out)
    told = " ".join(done.stdout.split())
    assert done.returncode == 1, done.stderr
    assert "s: the lidar stopped sending scans; check its cable" in told.split("ended after")[1]
    assert "not home: the lidar stopped sending scans" in told
    spent_s = json.loads((out / "summary.json").read_text(encoding="utf-8"))["time_s"]
    assert spent_s > float(told.split("ended after ")[1].split()[0]) - 0.5  # of all drives, not of the last
    assert {"map.yaml", "map.pgm", "summary.json"} <= {path.name for path in out.iterdir()}
