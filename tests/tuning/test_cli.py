"""The commands from outside: help without slow libraries, errors in one line."""

import json
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import Wheel, counted, steps_and_prbs
from rich.console import Console
from typer.testing import CliRunner

from tests.loaded_modules import help_of, printed_and_loaded
from thumper.cli.app import build_app
from thumper.common.errors import ThumperError
from thumper_tuning.cli.steps import ConsoleProgress
from thumper_tuning.cli.tune import Rule, report
from thumper_tuning.design.gains import RULE_NAMES

THUMPER = Path(sys.executable).with_name("thumper")


def test_help_loads_no_slow_library() -> None:
    slow = ("numpy", "numba", "scipy", "matplotlib", "serial", "control")
    commands = ("", "record", "fit", "design", "verify", "report")
    code = "".join(help_of("tune", *command.split()) for command in commands)
    printed, loaded = printed_and_loaded(code, slow)
    assert loaded == set()
    assert printed.count("--help") >= len(commands)


def test_the_help_of_fit_names_the_columns() -> None:
    done = subprocess.run([THUMPER, "tune", "fit", "--help"], capture_output=True, text=True, check=True)
    for name in ("time_s", "pwm", "voltage_V", "counts", "speed_rad_s", "--counts-per-rev", "--json"):
        assert name in done.stdout


def test_an_unusable_log_gives_one_line_on_stderr(tmp_path: Path) -> None:
    path = tmp_path / "still.csv"
    path.write_text("time_s,pwm,counts\n" + "".join(f"{0.1 * k},0,0\n" for k in range(300)))
    done = subprocess.run(
        [THUMPER, "tune", "fit", path, "--json"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 4
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "record" in done.stderr


@pytest.mark.slow
def test_a_report_uses_the_given_rate_and_battery(tmp_path: Path) -> None:
    time_s, pwm = 0.1 * np.arange(400.0), steps_and_prbs(400, seed=1)
    counts = counted(Wheel().drive(time_s, pwm, seed=1))
    log = tmp_path / "log.csv"
    rows = (f"{t:.1f},{u:.0f},{n:.0f}" for t, u, n in zip(time_s, pwm, counts, strict=True))
    log.write_text("time_s,pwm,counts\n" + "\n".join(rows) + "\n")
    report([log], out=tmp_path, rate=50, battery=3.7)
    gains = json.loads((tmp_path / "gains.json").read_text())
    assert gains["period_s"] == 0.02
    assert gains["gains"]["ks"] == pytest.approx(Wheel().friction * 3.7 / 7.4, rel=0.1), "ks refers to 7.4 V"
    assert (tmp_path / "report.html").exists()


def test_lines_on_the_terminal_keep_their_brackets(capsys: pytest.CaptureFixture[str]) -> None:
    """Such as the unit and the range of a column that was read."""
    progress = ConsoleProgress(console=Console(width=200), report_progress=lambda *_: None)
    progress.report_line("read time: column 'time_s' [s, 0.00 ... 21.30]")
    assert "[s, 0.00 ... 21.30]" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["tune", "tune record", "experiment speed"])
def test_the_board_may_have_another_baud_rate(tmp_path: Path, command: str) -> None:
    """That of the simulated board is 500 000."""
    options = ["--board", "sim://baud/board", "--baud", "250000", "--out", str(tmp_path), "--yes"]
    error = CliRunner().invoke(build_app(), [*command.split(), *options]).exception
    assert isinstance(error, ThumperError)
    assert error.exit_code == 3
    assert "the data at 250000 baud is not the Thumper protocol" in str(error)


@pytest.mark.parametrize("command", ["tune", "tune record", "experiment speed", "experiment odometry"])
def test_without_a_board_no_folder_stays(tmp_path: Path, command: str) -> None:
    options = ["--board", "/dev/ttyNONE9", "--out", str(tmp_path / "out/run"), "--yes"]
    error = CliRunner().invoke(build_app(), [*command.split(), *options]).exception
    assert isinstance(error, ThumperError)
    assert error.exit_code == 3
    assert not (tmp_path / "out").exists()


def test_the_help_names_all_rules() -> None:
    *names, last = RULE_NAMES
    assert get_args(Rule)[1].help == f"{', '.join(names)} or {last}."
