"""A kernel's files on disk: loaded by later processes, compiled again if they are old or damaged."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

AREA = """
from typing import NamedTuple

from thumper.common.numba_kernel import kernel


class Field(NamedTuple):
    width: int


@kernel
def area(field):
    return field.width * 2
"""
SOURCE = f"""{AREA}

if __name__ == "__main__":
    import program

    print(program.area(program.Field(21)), sum(program.area.compiled.stats.cache_hits.values()))
"""
CALLER = f"""
import sys{AREA}

@kernel
def share(field, part):
    return area(field) * part


if __name__ == "__main__":
    import program

    part = float(sys.argv[1]) if "." in sys.argv[1] else int(sys.argv[1])
    hits = (sum(each.compiled.stats.cache_hits.values()) for each in (program.area, program.share))
    print(program.share(program.Field(21), part), *hits)
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    path = tmp_path / "program.py"
    path.write_text(SOURCE)
    return path


def run(program: Path, *arguments: str) -> str:
    """Run the program; return its result and how many kernels it loaded from disk."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(program.parent / "cache")}
    done = subprocess.run(
        [sys.executable, program, *arguments], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.slow
def test_a_renamed_argument_class_does_not_break_an_upgrade(program: Path) -> None:
    assert run(program) == "42 0"
    assert run(program) == "42 1"
    program.write_text(SOURCE.replace("Field", "DistanceField"))
    assert run(program) == "42 0"
    assert run(program) == "42 1"


@pytest.mark.slow
def test_a_truncated_file_is_written_again(program: Path) -> None:
    run(program)
    for suffix in ("nbi", "nbc"):
        (file,) = (program.parent / "cache").rglob(f"*.{suffix}")
        file.write_bytes(file.read_bytes()[:-7])
        assert run(program) == "42 0", suffix
        assert run(program) == "42 1", suffix


@pytest.mark.slow
def test_a_kernel_is_compiled_around_one_from_disk(program: Path) -> None:
    program.write_text(CALLER)
    assert run(program, "2") == "84 0 0"
    assert run(program, "0.5") == "21.0 1 0"  # other types, so `share` alone is compiled
    assert run(program, "2") == "84 0 1"
