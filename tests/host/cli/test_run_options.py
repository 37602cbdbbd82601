"""The options of a run: what is checked first, and those of another simulated world."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest

from tests.host.cli.simulated_run import simulated_run
from thumper.common.errors import ThumperError


@pytest.mark.parametrize("option", ["saved_map", "session"])
def test_a_missing_file_is_reported_before_a_folder_that_is_in_use(tmp_path: Path, option: str) -> None:
    out, missing = tmp_path / "file", tmp_path / "nofile"
    out.touch()  # cannot be a folder
    options = replace(simulated_run(out), **cast("Any", {option: missing}))
    with pytest.raises(ThumperError, match=f"^{missing}: cannot be read .*; check the path$"):
        options.load_settings()


@pytest.mark.parametrize(
    ("board", "config", "expected"),
    [
        ("sim://", "", "sim://?world=hall"),
        ("sim://?world=lab&x_m=1&yaw_deg=90&seed=3", "", "sim://?world=hall&seed=3"),
        ("", 'port = "sim://setup/board?world=lab"', "sim://setup/board?world=hall"),
    ],
)
def test_another_world_keeps_the_robot_and_starts_a_new_map(
    tmp_path: Path, board: str, config: str, expected: str
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f"[board]\n{config}\n")
    options = replace(
        simulated_run(tmp_path),
        config=path,
        board=board,
        start=(1.0, 0.0, 90.0),
        session=tmp_path / "map.session",
    )
    other = options.in_world("hall", tmp_path / "hall")
    assert (other.board, other.start, other.session, other.out) == (expected, None, None, tmp_path / "hall")
    assert other.fresh
