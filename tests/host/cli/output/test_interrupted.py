"""Ctrl-C outside a drive reports what was unfinished, and the motors only if they could be on."""

from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner

from thumper.cli.app import build_app
from thumper.common.errors import ThumperError

ON_SIM = ["--board", "sim://interrupted/board?world=lab", "--lidar", "sim://interrupted/lidar"]


def _ctrl_c(*_: object, **__: object) -> NoReturn:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("where", "command", "message"),
    [
        ("thumper.runtime.assembly.warm_up", ["run", *ON_SIM], "interrupted"),
        ("thumper.runtime.assembly.warm_up", ["explore", *ON_SIM], "interrupted"),
        ("thumper.runtime.assembly.open_lidar", ["run", *ON_SIM], "interrupted; the motors are off"),
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
