"""A simulated board brings its own sensors: one line names the configured ports that are not used."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from thumper.cli.app import build_app
from thumper.cli.robot_run import RunOptions

CONFIG = """
[lidar]
port = "/dev/lidar"
[gps]
enabled = true
port = "/dev/gps"
[imu]
enabled = true
[camera]
port = "/dev/video2"
"""


def options(tmp_path: Path, board: str, lidar: str = "") -> RunOptions:
    config = tmp_path / "robot.toml"
    config.write_text(CONFIG)
    return RunOptions(
        config=config,
        board=board,
        lidar=lidar,
        bus="",
        start=None,
        session=None,
        out=tmp_path / "out",
        record=False,
        record_to=None,
    )


def test_a_simulated_board_names_the_ports_that_are_not_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = options(tmp_path, "sim://").load_settings()
    assert settings.gps.port.startswith("sim://")
    assert capsys.readouterr().err == (
        "thumper: the simulated board brings its own sensors; "
        "not used: [lidar] port /dev/lidar, [gps] port /dev/gps\n"
    )


def test_the_doctor_names_them_too(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text('[lidar]\nport = "/dev/lidar"\n')
    command = ["doctor", "--config", str(tmp_path / "robot.toml"), "--board", "sim://"]
    done = CliRunner().invoke(build_app(), [*command, "--seconds", "1"])
    assert "not used: [lidar] port /dev/lidar" in done.stderr


@pytest.mark.parametrize(("board", "lidar"), [("", ""), ("/dev/board", "/dev/another"), ("", "/dev/another")])
def test_a_real_board_has_nothing_to_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], board: str, lidar: str
) -> None:
    assert options(tmp_path, board, lidar).load_settings().gps.port == "/dev/gps"
    assert capsys.readouterr().err == ""
