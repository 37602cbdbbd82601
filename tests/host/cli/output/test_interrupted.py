"""Ctrl-C outside a drive reports what was unfinished, and the motors only if they could be on."""

from pathlib import Path
from typing import NoReturn

import pytest
from benchmarks.shared.live import free_port
from typer.testing import CliRunner

from thumper.cli.app import build_app
from thumper.common.errors import ThumperError
from thumper.runtime.loop import UNCONFIRMED, RobotLoop
from thumper_hil.bench import simulation

ON_SIM = ["--board", "sim://interrupted/board?world=lab", "--lidar", "sim://interrupted/lidar"]
RUN = ["run", *ON_SIM, "--bus", f"127.0.0.1:{free_port()}"]


def _ctrl_c(*_: object, **__: object) -> NoReturn:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("where", "command", "message"),
    [
        ("thumper.runtime.assembly.warm_up", RUN, "interrupted"),
        ("thumper.runtime.assembly.warm_up", ["explore", *ON_SIM], "interrupted"),
        ("thumper.runtime.assembly.open_lidar", RUN, "interrupted; the motors are off"),
        ("thumper.offline.map_log.open_log", ["map-log", "x.log"], "interrupted; the map was not finished"),
    ],
)
def test_ctrl_c_reports_what_was_unfinished(
    where: str, command: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(where, _ctrl_c)
    error = CliRunner().invoke(build_app(), [*command, "--out", str(tmp_path)]).exception
    assert isinstance(error, ThumperError)
    assert (str(error), error.exit_code) == (message, 130)


def _lose_all_bytes(name: str) -> None:
    simulation(name).fault("line.loss", 1.0)
    raise KeyboardInterrupt


def test_an_unconfirmed_stop_of_a_serving_robot_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RobotLoop, "cycle", lambda _: _lose_all_bytes("interrupted"))
    result = CliRunner().invoke(
        build_app(), ["run", *ON_SIM, "--bus", f"127.0.0.1:{free_port()}", "--out", str(tmp_path)]
    )
    assert result.exit_code == 0
    assert UNCONFIRMED in result.output
    assert "stopped" not in result.output


def test_an_unconfirmed_stop_after_ctrl_c_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drive has not started, so it has no result that could say so."""
    monkeypatch.setattr(RobotLoop, "cycle", lambda _: _lose_all_bytes("interrupted"))
    command = ["run", *ON_SIM, "--goal", "0.3", "0", "--out", str(tmp_path)]
    error = CliRunner().invoke(build_app(), command).exception
    assert isinstance(error, ThumperError)
    assert (str(error), error.exit_code) == (f"interrupted; {UNCONFIRMED}", 130)
