"""The recording commands: conversion, and invalid input with one line and the right exit status."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from benchmarks.shared.recorded_run import RUN, cycles

from thumper.recording.recorder import Recorder

Thumper = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def thumper(in_process: Thumper) -> Thumper:
    """Thumper each command in this process: its files, messages and exit status are the same."""
    return in_process


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("replay", "none.mcap"), 2, "none.mcap: cannot be read"),
        (("replay", "bad.mcap"), 2, "bad.mcap: not an MCAP file"),
        (("replay", "empty"), 2, "no recording"),
        (("export", "bad.mcap"), 2, "nothing to export"),
        (("export", "bad.mcap", "--csv", "x"), 2, "not an MCAP file"),
        (("export", "bad.mcap", "--animation", "x.mp4"), 2, "end the name in .webp or .gif"),
        (("recover", "bad.mcap"), 2, "bad.mcap: not an MCAP file"),
        (
            ("recover", "none.mcap"),
            2,
            "none.mcap: cannot be read (No such file or directory); check the path",
        ),
        (("tune", "fit", "none.csv"), 2, "none.csv: cannot be read (No such file or directory); check"),
        (("record", "--bus", "127.0.0.1:9"), 3, "no robot is running"),
        (("teleop", "--bus", "127.0.0.1:9"), 3, "no robot is running"),
        (("map-log", "bad.mcap"), 2, "unknown log format"),
    ],
)
def test_errors_take_one_line(
    thumper: Thumper, tmp_path: Path, arguments: tuple[str, ...], code: int, words: str
) -> None:
    (tmp_path / "bad.mcap").write_text("hello")
    (tmp_path / "empty").mkdir()
    here = [
        str(tmp_path / part) if part in ("none.mcap", "bad.mcap", "empty", "x") else part
        for part in arguments
    ]
    done = thumper(*here)
    assert done.returncode == code
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert (tmp_path / "bad.mcap").read_text() == "hello"


def test_record_replay_and_export(thumper: Thumper, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, RUN)
    for topic, now_s, message in cycles(30):
        recorder(topic, now_s, message)
    recorder.close()
    torn = tmp_path / "torn.mcap.part"
    torn.write_bytes(recorder.files[0].read_bytes()[:-400])
    assert "torn.mcap: repaired" in thumper("recover", tmp_path).stdout
    whole = tmp_path / "torn.mcap"
    png = ("--png", tmp_path / "p.png")
    outputs = (("--csv", tmp_path / "t", "cmd_vel.csv"), ("--map", tmp_path / "m.v1", "m.v1.yaml"))
    given = [argument for option, path, _ in outputs for argument in (option, path)]
    done = thumper("export", whole, *given, *png)
    assert done.returncode == 0, done.stderr
    for option, path, there in outputs:
        refused = thumper("export", whole, option, path)
        assert refused.returncode == 2
        assert f"{there} already exists; choose another {option} or add --force" in refused.stderr
    assert thumper("export", whole, *given, "--force").returncode == 0
    assert (tmp_path / "t" / "wheels.csv").stat().st_size > 1000
    assert (tmp_path / "m.v1.pgm").exists()
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    done = thumper("replay", whole, "--out", tmp_path / "r")
    assert done.returncode == 0, done.stderr
    assert "scans mapped" in done.stdout
    assert {path.name for path in (tmp_path / "r").iterdir()} == {
        "map.pgm",
        "map.yaml",
        "map.session",
        "map.png",
        "trajectory.csv",
    }
