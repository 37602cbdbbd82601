"""The commands as a user meets them: help without slow libraries, refusals in one line."""

import subprocess
import sys
from pathlib import Path

import pytest

THUMPER = Path(sys.executable).with_name("thumper")


@pytest.mark.parametrize("command", ["", "record", "fit", "design", "verify", "report"])
def test_help_loads_no_slow_library(command: str) -> None:
    code = (
        f"import sys; sys.argv = ['thumper', 'tune', *{command!r}.split(), '--help']\n"
        "from thumper.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print({'numpy', 'numba', 'scipy', 'matplotlib', 'serial', 'control'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
    assert "--help" in done.stdout


def test_fit_names_the_columns_in_its_help() -> None:
    done = subprocess.run([THUMPER, "tune", "fit", "--help"], capture_output=True, text=True, check=True)
    for name in ("time_s", "pwm", "voltage_V", "counts", "speed_rad_s", "--counts-per-rev", "--json"):
        assert name in done.stdout


def test_a_log_that_says_nothing_is_one_line_on_stderr(tmp_path: Path) -> None:
    path = tmp_path / "still.csv"
    path.write_text("time_s,pwm,counts\n" + "".join(f"{0.1 * k},0,0\n" for k in range(300)))
    done = subprocess.run(
        [THUMPER, "tune", "fit", path, "--json"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 4
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "record" in done.stderr
