"""Two robot processes do not write to one output folder."""

from pathlib import Path

import pytest

from thumper.cli.output.folder import reserved
from thumper.cli.robot_run import RunOptions, opened_robot
from thumper.common.errors import ThumperError
from thumper.config.robot import RobotConfig


def test_a_second_robot_neither_resumes_nor_replaces_the_map_of_a_running_one(tmp_path: Path) -> None:
    session = tmp_path / "autosave.session"
    session.write_text("of the running robot")
    options = RunOptions(
        config=None,
        board="sim://",
        lidar="",
        bus="",
        start=None,
        session=None,
        out=tmp_path,
        record=False,
        record_to=None,
        fresh=True,
    )
    with (
        reserved(tmp_path),
        pytest.raises(ThumperError, match=r"another robot process writes to .*; stop it, or .* --out"),
        opened_robot(options, RobotConfig()),
    ):
        pass
    assert session.read_text() == "of the running robot"


def test_the_folder_is_free_again_afterwards(tmp_path: Path) -> None:
    for _ in range(2):
        with reserved(tmp_path):
            pass
