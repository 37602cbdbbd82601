"""Kernels that a package brings: found in place, for this computer, and never with other sources."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from thumper.common.kernel_files import FOLDER
from thumper.common.numba_kernel import SHIP_VARIABLE

CONSTANT = "FACTOR = 2\n"
HELPER = """
from thumper.common.numba_kernel import kernel
from thumper_sample.constant import FACTOR


@kernel
def doubled(x):
    return FACTOR * x
"""
PROGRAM = """
from thumper.common.numba_kernel import kernel
from thumper_sample.helper import doubled


@kernel
def area(width):
    return doubled(width) + 1


if __name__ == "__main__":
    from numba.core import event

    with event.install_recorder("numba:compile") as compiled:
        from thumper_sample.program import area

        print(area(20), len(compiled.buffer) // 2)
"""


class Package:
    """A package with kernels, and a user without any."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "thumper_sample"
        self._cache = folder / "cache"

    def run(self, **environment: str) -> str:
        """Run the program for a new user; return its result and how many kernels it compiled."""
        shutil.rmtree(self._cache, ignore_errors=True)
        return self.run_again(**environment)

    def run_again(self, **environment: str) -> str:
        """Run the program for the same user."""
        path = os.pathsep.join((str(self.folder.parent), os.environ.get("PYTHONPATH", "")))
        # Without bytecode: Python's own does not notice a change that leaves time and size of a source.
        done = subprocess.run(
            [sys.executable, "-B", "-m", "thumper_sample.program"],
            env=os.environ | {"NUMBA_CACHE_DIR": str(self._cache), "PYTHONPATH": path} | environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    @property
    def cached(self) -> list[Path]:
        """The kernels of the user."""
        return list(self._cache.rglob("*.nbc"))


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a package whose kernels were compiled when it was made."""
    package = Package(tmp_path_factory.mktemp("shipped"))
    package.folder.mkdir()
    sources = {"__init__": "", "constant": CONSTANT, "helper": HELPER, "program": PROGRAM}
    for name, source in sources.items():
        (package.folder / f"{name}.py").write_text(source)
    assert package.run(**{SHIP_VARIABLE: "1"}) == "41 2"
    assert not package.cached
    assert len(list((package.folder / FOLDER).rglob("*.nbc"))) == 2
    return package.folder


@pytest.fixture
def package(tmp_path: Path, shipped: Path) -> Package:
    """Return an installed copy of the package."""
    package = Package(tmp_path)
    shutil.copytree(shipped, package.folder)
    return package


@pytest.mark.slow
def test_a_new_user_of_a_moved_package_compiles_nothing(package: Package) -> None:
    for source in package.folder.glob("*.py"):
        os.utime(source)  # an installer writes new times
    assert package.run() == "41 0"
    assert not package.cached


@pytest.mark.parametrize(
    ("name", "old", "new", "result"),
    [
        ("constant", "2", "3", "61 2"),
        pytest.param("helper", "* x", "* x + 1", "42 2", marks=pytest.mark.slow),
        pytest.param("program", "+ 1", "+ 2", "42 1", marks=pytest.mark.slow),
    ],
)
def test_changed_sources_are_compiled_with_all_that_depends_on_them(
    package: Package, name: str, old: str, new: str, result: str
) -> None:
    source = package.folder / f"{name}.py"
    text, status = source.read_text(), source.stat()
    source.write_text(text.replace(old, new))
    os.utime(source, ns=(status.st_atime_ns, status.st_mtime_ns))  # the time stays
    assert package.run() == result
    assert package.run_again() == result.split(maxsplit=1)[0] + " 0"
    source.write_text(text)
    assert package.run_again() == "41 0"  # the package's kernels are not overwritten


def test_another_processor_compiles_its_own(package: Package) -> None:
    assert package.run(NUMBA_CPU_NAME="generic") == "41 2"


def test_damaged_kernels_are_not_used_and_not_touched(package: Package) -> None:
    for file in (package.folder / FOLDER).rglob("*.nb?"):
        file.write_bytes(file.read_bytes()[:-7])
    before = {path: path.read_bytes() for path in (package.folder / FOLDER).rglob("*.nb?")}
    assert package.run() == "41 2"
    assert package.run_again() == "41 0"
    assert {path: path.read_bytes() for path in before} == before


def test_the_kernels_are_used_where_nothing_can_be_written(package: Package) -> None:
    unusable = package.folder.parent / "file"
    unusable.touch()
    places = {"NUMBA_CACHE_DIR": str(unusable), "HOME": str(unusable), "XDG_CACHE_HOME": str(unusable)}
    shutil.rmtree(package.folder / "__pycache__", ignore_errors=True)
    (package.folder / "__pycache__").touch()
    assert package.run_again(**places) == "41 0"
    source = package.folder / "constant.py"
    source.write_text(CONSTANT.replace("2", "3"))
    assert package.run_again(**places) == "61 2"
