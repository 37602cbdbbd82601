"""`--help` groups the commands and names the options of each."""

import re
from collections.abc import Callable
from typing import get_args

import pytest

from tests.host.cli.conftest import Ended
from thumper.cli.app import PANELS
from thumper.cli.map_log import Mount
from thumper.ros.topics import TOPICS

Run = Callable[..., Ended]

COMMANDS = {
    "demo": ["--out", "--seed"],
    "run": ["--board", "--lidar", "--goal", "--config", "out/run"],
    "sim": ["--board-pty", "--lidar-pty", "--world"],
    "map-log": ["--out"],
    "mode": ["--bus"],
    "save": ["--bus"],
    "tune": ["--board", "--lane", "record", "fit", "design", "verify", "report"],
    "experiment": ["odometry", "speed"],
    "calibrate": ["odometry"],
    "doctor": ["--board", "--lidar"],
    "goto": ["--tolerance", "--bus", "--clear-fault"],
    "stop": ["--emergency"],
    "status": ["--json"],
    "watch": ["--json", "--count"],
    "ros": ["--router", "--domain", "--namespace"],
    "foxglove": ["--port", "--host"],
    "bus": ["keys"],
    "campaign": ["--workers", "--out"],
    "dock": ["--undock", "--bus"],
    "explore": ["--board", "--bus", "--ui", "out/explore"],
    "plan": ["--start", "--goal"],
    "edit": ["--rotate", "--free", "--crop", "--out"],
    "flash": ["--board", "--model"],
    "parameters": ["--board", "--config"],
    "setup": ["--config", "--bus", "--port"],
    "dashboard": ["--host", "--port", "--make-certificate"],
    "record": ["--out", "--seconds"],
    "teleop": ["--gamepad", "--bus"],
    "replay": ["--speed"],
    "recover": [],
    "export": ["--csv", "--map", "--png"],
}


def test_overview_lists_the_commands(thumper: Run) -> None:
    done = thumper("--help")
    assert done.status == 0
    listed = done.out[done.out.index("Try it without hardware") :]
    names = re.findall(r"^│ ([a-z-]+) ", listed, re.MULTILINE)
    assert set(names) == set(COMMANDS)
    assert names[0] == "demo"
    assert "Others" not in done.out, "each command has a group"


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_lists_its_options(thumper: Run, command: str) -> None:
    done = thumper(command, "--help")
    assert done.status == 0
    assert all(option in done.out for option in COMMANDS[command])


def test_help_keeps_text_in_brackets(thumper: Run) -> None:
    assert "X in the map [m]," in thumper("goto", "--help").out


def test_help_shows_no_type_for_a_flag(thumper: Run) -> None:
    for arguments in ([], ["demo"], ["goto"], ["tune", "record"]):
        assert "<bool>" not in thumper(*arguments, "--help").out


def test_help_shows_types_in_words(thumper: Run) -> None:
    shown = " ".join(word.strip("│") for word in thumper("run", "--help").out.split())
    assert "<number> 0.02 to 1.0" in shown
    for command in COMMANDS:
        assert not re.search(r"<(float|int|str|list)|range>|<=x", thumper(command, "--help").out)


def test_help_of_map_log_explains_each_choice_of_mount(thumper: Run) -> None:
    """A list of choices would break inside their names."""
    shown = " ".join(word.strip("│") for word in thumper("map-log", "--help").out.split())
    assert "--mount <mount>" in shown
    explained = shown[shown.index("How to read the log") : shown.index("--session <path>")]
    assert set(get_args(Mount)) <= set(re.findall(r"[\w-]+", explained))


def test_help_shows_defaults_of_settings_as_the_others(thumper: Run) -> None:
    defaults = re.findall(r"\[default: (.*?)\]", thumper("tune", "--help").out)
    assert defaults == ["/dev/ttyUSB0", "500000", "out/tune", "1.2", "1.5", "migo", "1.6"]


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_an_example(thumper: Run, command: str) -> None:
    shown = " ".join(thumper(command, "--help").out.split())
    assert re.search(r"Example: thumper|Examples: • thumper", shown)
    assert not re.search(r"thumper [^,]*, thumper", shown), "one example a line, to copy it"


def test_help_of_many_options_has_panels(thumper: Run) -> None:
    for command in ("run", "explore"):
        shown = re.findall(r"─ (\w+) ─", thumper(command, "--help").out)
        assert shown == ["Goal", "Dashboard", "Robot", "Map", "Output", "Others"]


def test_overview_has_the_panels_of_the_reference_in_its_order(thumper: Run) -> None:
    shown = re.findall(r"─ (\w[^─]*) ─", thumper("--help").out)
    assert shown == ["Options", *PANELS]


def test_overview_says_where_to_start(thumper: Run) -> None:
    assert thumper("--help").out.rstrip().endswith("thumper setup with one.")


def test_help_of_watch_lists_the_topics(thumper: Run) -> None:
    shown = " ".join(word.strip("│") for word in thumper("watch", "--help").out.split())
    assert ", ".join(TOPICS) in " ".join(shown.split())
