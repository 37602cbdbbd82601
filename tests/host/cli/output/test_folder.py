"""Output folders: two robot processes do not write to one, and failed work leaves no empty one."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from tests.host.cli.simulated_run import simulated_run
from thumper.cli.output.folder import new_output, reserved
from thumper.cli.robot_run import opened_robot
from thumper.common.errors import ThumperError
from thumper.config.robot import RobotConfig


def test_a_second_robot_neither_resumes_nor_replaces_the_map_of_a_running_one(tmp_path: Path) -> None:
    session = tmp_path / "autosave.session"
    session.write_text("of the running robot")
    options = replace(simulated_run(tmp_path), fresh=True)
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


@pytest.mark.parametrize(
    ("is_new", "with_file", "stays"), [(True, False, False), (True, True, True), (False, False, True)]
)
def test_failed_work_removes_an_empty_folder_that_it_made(
    tmp_path: Path, is_new: bool, with_file: bool, stays: bool
) -> None:
    folder = tmp_path / "out/experiment"
    if not is_new:
        folder.mkdir(parents=True)
    with suppress(ThumperError), new_output(folder):
        assert folder.is_dir()
        if with_file:
            (folder / "map.png").touch()
        raise ThumperError("no log")
    assert folder.parent.exists() == folder.exists() == stays
