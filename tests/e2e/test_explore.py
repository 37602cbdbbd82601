"""`thumper explore`: its events, and a robot that fails: it reports why and saves the map so far."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from benchmarks.shared.live import free_port

from thumper.recording.reader import Recording, find_recordings
from thumper.runtime.drive.data_age import LIDAR_LOST

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.slow
def test_a_lost_lidar_ends_exploration_and_saves_the_map(thumper: Run, tmp_path: Path) -> None:
    (tmp_path / "faults.toml").write_text('faults = [{ at_s = 6.0, lidar = "unplugged" }]\n')
    board = f"sim://robot/board?world=lab&scenario={tmp_path / 'faults.toml'}"
    out = tmp_path / "out"
    (tmp_path / "robot.toml").write_text(f"[dashboard]\nport = {free_port()}\n", encoding="utf-8")
    ui = ("--ui", "--config", tmp_path / "robot.toml")
    done = thumper("explore", "--board", board, "--lidar", "sim://robot/lidar", "--out", out, *ui)
    assert "dashboard: http://" in done.stdout
    told = " ".join(done.stdout.split())
    assert done.returncode == 1, done.stderr
    assert "s: the lidar stopped sending scans; check its cable" in told.split("ended after")[1]
    assert "not back at the start: the lidar stopped sending scans" in told
    spent_s = json.loads((out / "summary.json").read_text(encoding="utf-8"))["time_s"]
    assert spent_s > float(told.split("ended after ")[1].split()[0]) - 0.5  # of all drives, not of the last
    assert {"map.yaml", "map.pgm", "summary.json"} <= {path.name for path in out.iterdir()}


@pytest.mark.slow
def test_stop_between_two_drives_does_not_lose_the_lidar(thumper: Run, tmp_path: Path) -> None:
    record = ("--record-to", tmp_path / "rec", "--out", tmp_path / "out")
    done = thumper(
        "explore", "--board", "sim://robot/board?world=lab", "--lidar", "sim://robot/lidar", *record
    )
    assert done.returncode == 0, done.stderr
    recording = Recording(find_recordings([tmp_path / "rec"]))
    events = [message.decode().msg for message in recording.messages() if message.topic == "events"]
    assert sum(": at the goal" in event for event in events) >= 2  # drives that ended with a stop
    assert LIDAR_LOST not in events
