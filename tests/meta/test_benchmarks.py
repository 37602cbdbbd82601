"""`make bench` runs every benchmark and collects its figures, and its page has a place for them."""

import os
from pathlib import Path

import pytest
from benchmarks import table
from benchmarks.table import BENCHMARKS, HERE, MARK, PAGE


def test_every_benchmark_is_in_the_table() -> None:
    programs = {path.stem for path in HERE.glob("*.py")} - {"figure", "table"}
    assert set(BENCHMARKS) == programs


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Return the folder from which `table.run` starts benchmarks."""
    monkeypatch.setattr(table, "HERE", tmp_path)
    paths = [str(HERE.parent), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    return tmp_path


def test_figures_of_a_benchmark_become_rows(folder: Path) -> None:
    (folder / "fast.py").write_text(
        "import sys\n"
        "from benchmarks.figure import figure\n"
        "figure(f'speed {sys.argv[1]}', '3', 'm/s', aim='4', peers='theirs 2', source='a paper')\n"
    )
    figures, succeeded = table.run("fast", "--all")
    assert succeeded
    (row,) = [table.line("fast", figure) for figure in figures]
    assert row.startswith("| fast | speed --all | 3 m/s | 4 | theirs 2 (a paper) | ")


def test_failed_benchmark_keeps_its_figures_and_gets_a_row(folder: Path) -> None:
    (folder / "broken.py").write_text(
        "from benchmarks.figure import figure\nfigure('speed', '3')\nraise SystemExit(3)\n"
    )
    figures, succeeded = table.run("broken", "")
    assert not succeeded
    assert [figure["ours"] for figure in figures] == ["3", "failed with status 3"]


def test_every_benchmark_has_rows_on_the_page() -> None:
    text, mark, rows = PAGE.read_text(encoding="utf-8").partition(MARK)
    assert text
    assert mark
    for name in BENCHMARKS:
        assert f"\n| {name} | " in rows, name
