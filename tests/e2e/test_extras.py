"""A command whose packages are missing names them in one line, before it does anything."""

import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.hil.campaign.samples import FILE
from tests.variants import some_of
from thumper.common.optional_packages import EXTRAS, missing_package

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]

RUN_WITHOUT = """
import sys
sys.modules[sys.argv.pop(1)] = None
from thumper.cli.app import main
main()
"""


@pytest.mark.parametrize(
    ("module", "extra", "command"),
    [
        ("nicegui", "ui", "dashboard"),
        ("foxglove", "foxglove", "foxglove"),
        ("dask", "campaign", "campaign c.toml"),
    ],
)
def test_missing_packages_are_named_with_the_install_command(
    module: str, extra: str, command: str, tmp_path: Path
) -> None:
    (tmp_path / "c.toml").write_text(
        '[[missions]]\nname = "m"\nworld = "lab"\nstart = [0, 0, 0]\ngoal = [1, 0]\n'
    )
    arguments = [sys.executable, "-c", RUN_WITHOUT, module, *command.split()]
    done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 4, done.stderr
    assert done.stdout == ""
    install = f"{sys.executable} -m pip install 'thumper-robot[{extra}]'"
    assert done.stderr == f"thumper: {EXTRAS[extra][0]} needs {module}, which is not installed: {install}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["c.toml"]


@pytest.mark.parametrize(
    "extra", some_of(sorted(EXTRAS.keys() - {"notebooks"}))
)  # JupyterLab is not installed
def test_pip_takes_the_extra_from_the_installed_package(extra: str) -> None:
    """No index is asked: the packages of the extra, which are installed here, satisfy the command."""
    if not all(map(find_spec, EXTRAS[extra][1])):
        pytest.skip(f"the extra {extra} is not installed")
    assert extra in PROJECT["optional-dependencies"]
    command = str(missing_package(extra, "it")).partition(": ")[2]
    pip = f"{command} --dry-run --no-index --disable-pip-version-check"
    done = subprocess.run(pip, shell=True, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{PROJECT['name']}[{extra}]" in done.stdout


@pytest.mark.slow
def test_a_campaign_without_pyarrow_writes_csv(tmp_path: Path) -> None:
    two_sets = 'parameters = [{ name = "default" }, { name = "gentle", robot = "gentle.toml" }]'
    (tmp_path / "c.toml").write_text(FILE.replace("count = 2", "count = 1").replace(two_sets, ""))
    arguments = [
        sys.executable,
        "-c",
        RUN_WITHOUT,
        "pyarrow",
        "campaign",
        "c.toml",
        "--out",
        "o",
        "--workers",
        "1",
    ]
    done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stderr
    assert "in o/: rows.csv, summary.md, summary.png\n" in done.stdout
    assert len((tmp_path / "o" / "rows.csv").read_text().splitlines()) == 2
    assert not (tmp_path / "o" / "rows.parquet").exists()
