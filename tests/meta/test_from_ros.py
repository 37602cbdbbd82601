"""Each line of the page for users of ROS names a command that exists or a setting that loads."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from thumper.cli.app import build_app
from thumper.config.robot import load_config

PAGE = Path(__file__).parents[2] / "docs/explanation/from-ros.md"
ROWS = [line.split(" | ") for line in PAGE.read_text().splitlines() if line.startswith("| ")][1:]
SETTING = re.compile(r"\[([\w.]+)\] (\w+ = .+)")


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].strip("| "))
def test_line_is_shown_by_something_that_exists(row: list[str], tmp_path: Path) -> None:
    assert len(row) == 3
    shown = re.findall(r"`([^`]+)`", row[2])
    assert shown
    for one in [*shown, *re.findall(r"`(\[[^`]+ = [^`]+)`", row[1])]:
        if match := SETTING.fullmatch(one):
            (tmp_path / "robot.toml").write_text(f"[{match[1]}]\n{match[2]}\n")
            load_config(tmp_path / "robot.toml")
        elif one.startswith("thumper "):
            check_command(shlex.split(one)[1:])
        else:
            assert one.startswith("/")  # a ROS topic, beside a command


def check_command(words: list[str]) -> None:
    """Parse the words as the program does, without running the command."""
    app: Any = typer.main.get_command(build_app())
    assert words[0] in app.commands
    app.commands[words[0]].make_context(words[0], words[1:])
