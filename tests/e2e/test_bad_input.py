"""Invalid input gives a one-line error and a non-zero exit status, never a traceback.

Commands that open no robot run in this process.
"""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., subprocess.CompletedProcess[str]]

SIM = ("--board", "sim://robot/board?world=lab", "--lidar", "sim://robot/lidar")


def refused(done: subprocess.CompletedProcess[str], *named: str) -> None:
    assert done.returncode not in (0, None)
    assert "Traceback" not in done.stdout + done.stderr
    lines = [line for line in done.stderr.splitlines() if line.startswith("thumper: ")]
    assert len(lines) == 1, done.stderr
    for part in named:
        assert part in lines[0]


def test_missing_board_port(in_process: Run, tmp_path: Path) -> None:
    done = in_process("run", "--board", "/dev/ttyNONE9", "--goal", "1", "0", "--out", tmp_path)
    refused(done, "/dev/ttyNONE9", "no such port")
    assert done.returncode == 3


def test_missing_lidar_port(thumper: Run, tmp_path: Path) -> None:
    done = thumper("run", *SIM[:2], "--lidar", "/dev/ttyNONE8", "--goal", "1", "0", "--out", tmp_path)
    refused(done, "/dev/ttyNONE8", "no such port")


def test_board_port_is_the_lidar(in_process: Run, tmp_path: Path) -> None:
    done = in_process("run", "--board", "sim://robot/lidar", "--goal", "1", "0", "--out", tmp_path)
    refused(done, "sim://robot/lidar")


@pytest.mark.parametrize(
    ("url", "named"),
    [
        ("sim://robot/board?world=atlantis", "atlantis: unknown world"),
        ("sim://robot/board?colour=red", "'colour'"),
        ("simm://robot/board", "simm://robot/board"),
    ],
)
def test_invalid_simulated_port(in_process: Run, tmp_path: Path, url: str, named: str) -> None:
    done = in_process("run", "--board", url, "--goal", "1", "0", "--out", tmp_path)
    refused(done, named)
    assert done.returncode == 2


def test_unknown_key_in_the_configuration(in_process: Run, tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[navigation]\nspeeed = 3\n")
    refused(in_process("run", *SIM, "--goal", "1", "0", "--config", config), str(config), "navigation.speeed")


@pytest.mark.parametrize("name", ["", "../up", "*"])
def test_invalid_robot_name_in_the_configuration(in_process: Run, tmp_path: Path, name: str) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f'name = "{name}"\n')
    refused(in_process("status", "--config", config), str(config), "name")


def test_invalid_robot_name_option(in_process: Run) -> None:
    refused(in_process("status", "--robot", "**", "--bus", "127.0.0.1:1"), "--robot", "'**'")


def test_configuration_that_contradicts_the_firmware(thumper: Run, tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[drive]\ncounts_per_rev = 1000\n")
    done = thumper("run", *SIM, "--goal", "1", "0", "--config", config, "--out", tmp_path)
    refused(done, "1200 counts", "1000")


def test_output_folder_that_cannot_be_written(in_process: Run, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.touch()
    for command in (("run", *SIM, "--goal", "1", "0"), ("demo",)):
        refused(in_process(*command, "--out", blocker / "out"), str(blocker), "cannot write")


def test_goal_inside_an_obstacle(thumper: Run, tmp_path: Path) -> None:
    """The goal is 0.5 m behind the wall that the robot faces."""
    board = "sim://robot/board?world=lab&x_m=2.0&y_m=0&yaw_deg=0"
    done = thumper(
        "run", "--board", board, "--lidar", "sim://robot/lidar", "--start", "2", "0", "0",
        "--goal", "3.2", "0", "--tolerance", "0.05", "--out", tmp_path,
    )  # fmt: skip
    refused(done, "goal", "(3.20, 0.00)")


def test_goal_far_outside_any_map(thumper: Run, tmp_path: Path) -> None:
    refused(thumper("run", *SIM, "--goal", "4000", "0", "--out", tmp_path), "goal", "4000")


@pytest.mark.parametrize(
    ("places", "problem"),
    [
        (("--goal", "99", "0"), "99 m from the start"),
        (("--waypoint", "1", "0", "--waypoint", "99", "0"), "98 m from the goal before, (1.00, 0.00)"),
    ],
)
def test_a_goal_too_far_from_the_place_before_opens_nothing(
    in_process: Run, tmp_path: Path, places: tuple[str, ...], problem: str
) -> None:
    done = in_process("run", *SIM, *places, "--out", tmp_path)
    refused(done, f"goal (99.00, 0.00) is {problem}")
    assert done.returncode == 2
    assert done.stdout == ""


def test_file_that_is_not_a_log(in_process: Run, tmp_path: Path) -> None:
    log = tmp_path / "shopping.log"
    log.write_text("milk\n")
    refused(in_process("map-log", log, "--out", tmp_path), str(log))
    refused(in_process("map-log", tmp_path / "none.clf", "--out", tmp_path), "none.clf")


def test_log_with_one_scan(in_process: Run, tmp_path: Path) -> None:
    log = tmp_path / "one.log"
    ranges_m = " ".join(f"{2.0 + 0.005 * k:.3f}" for k in range(180))
    log.write_text(f"FLASER 180 {ranges_m} 0 0 0 0 0 0 1.0 host 1.0\n")
    done = in_process("map-log", log, "--out", tmp_path / "out")
    assert done.stdout.startswith("CARMEN log: 1 scan, 0.0 m driven, no scan matched with a map\n")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--tolerance", "0.2"), "--tolerance belongs to --goal"),
        (("--clear-fault",), "--clear-fault belongs to --goal"),
        (("--goal", "1", "0", "--speed", "2"), "--speed belongs to a run without a goal"),
        (("--route", "r.toml", "--speed", "2"), "--speed belongs to a run without a goal"),
        (("--route", "r.toml", "--goal", "1", "0"), "--goal belongs to a run without --route"),
        (("--route", "r.toml", "--tolerance", "0.2"), "--tolerance belongs to a run without --route"),
    ],
)
def test_an_option_without_effect(in_process: Run, arguments: tuple[str, ...], named: str) -> None:
    done = in_process("run", *SIM, *arguments)
    refused(done, named)
    assert done.returncode == 2
