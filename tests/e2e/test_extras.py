"""A command whose packages are missing names them in one line, before it does anything."""

import subprocess
import sys
from pathlib import Path

import pytest

from thumper.common.optional_packages import EXTRAS, missing_package

RUN_WITHOUT = """
import sys
sys.modules[sys.argv.pop(1)] = None
from thumper.cli.app import main
main()
"""


@pytest.mark.parametrize(
    ("module", "package", "command"),
    [
        ("nicegui", "nicegui", "dashboard"),
        ("foxglove", "foxglove-sdk", "foxglove"),
        ("dask", "dask[distributed]", "campaign c.toml"),
        ("pyarrow", "pyarrow", "campaign c.toml"),
    ],
)
def test_missing_packages_are_named_with_the_install_command(
    module: str, package: str, command: str, tmp_path: Path
) -> None:
    (tmp_path / "c.toml").write_text(
        'name = "c"\n[[missions]]\nname = "m"\nworld = "lab"\nstart = [0, 0, 0]\ngoal = [1, 0]\n'
    )
    arguments = [sys.executable, "-c", RUN_WITHOUT, module, *command.split()]
    done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 4, done.stderr
    assert done.stdout == ""
    assert f"needs {module}, which is not installed: {sys.executable} -m pip install " in done.stderr
    assert f"'{package}" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["c.toml"]


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_extra_exists(extra: str) -> None:
    assert "pip install '" in str(missing_package(extra, "it"))
