"""`make bench` runs every benchmark and collects its figures, and its pages have a place for them."""

import os
from pathlib import Path

import pytest
from benchmarks import table
from benchmarks.table import AREAS, BENCHMARKS, HEADLINES, HERE, MARK, PAGE, PAGES


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
        "figure(f'speed {sys.argv[1]}', '3', 'm/s', aim='<= 4', peers='theirs 2', source='a paper')\n"
    )
    figures, succeeded = table.run("fast", "--all")
    assert succeeded
    (row,) = [table.line(figure) for figure in figures]
    assert row.startswith("| speed --all | 3 m/s | ≤ 4 | theirs 2 (a paper) | ")


def test_failed_benchmark_keeps_its_figures_and_gets_a_row(folder: Path) -> None:
    (folder / "broken.py").write_text(
        "from benchmarks.figure import figure\nfigure('speed', '3')\nraise SystemExit(3)\n"
    )
    figures, succeeded = table.run("broken", "")
    assert not succeeded
    assert [figure["ours"] for figure in figures] == ["3", "failed with status 3"]


def test_every_benchmark_has_rows_on_one_page() -> None:
    assert sorted(name for _, names in AREAS.values() for name in names) == sorted(BENCHMARKS)
    assert {path.stem for path in PAGES.glob("*.md")} == set(AREAS)
    rows = table.read_rows()
    assert all(rows[name] for name in BENCHMARKS), rows


def test_headlines_are_rows() -> None:
    rows = table.read_rows()
    for name, what in HEADLINES:
        assert any(row.startswith(f"| {what} |") for row in rows[name]), what


def test_pages_written_again_are_the_same(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = {path.name: path.read_text(encoding="utf-8") for path in [PAGE, *PAGES.glob("*.md")]}
    rows = table.read_rows()
    page = tmp_path / PAGE.name
    page.write_text(before[PAGE.name], encoding="utf-8")
    monkeypatch.setattr(table, "PAGE", page)
    monkeypatch.setattr(table, "PAGES", tmp_path / "pages")
    monkeypatch.setattr(table, "machine", lambda: before[PAGE.name].partition(MARK)[2].split("\n")[1])
    (tmp_path / "pages").mkdir()
    table.write_pages(rows)
    after = {
        path.name: path.read_text(encoding="utf-8") for path in [page, *(tmp_path / "pages").glob("*.md")]
    }
    assert after == before


@pytest.mark.parametrize(
    ("ours", "aim", "missed"),
    [
        ("0.0195 m", "<= 0.022", False),
        ("193 MB", "<= 190", True),
        ("85.8 %", ">= 88", True),
        ("16 of 17", ">= 95 %", True),
        ("20 of 20", "18 of 20", False),
        ("17 of 20", "18 of 20", True),
        ("13", "0", True),
        ("1 / 9", "0 / -", True),
        ("0 / 9", "0 / -", False),
        ("-0.5 / +5.9 / +0.5 (%, %, PWM)", "+- 2 / +- 5 / +- 2", True),
        ("0.998 x that of navfn", "1 +- 0.01", False),
        ("75 +- 9 ms", "60 to 110", False),
        ("1.9 / 2.1 ms", "<= 2", True),
        ("0.026 m", "> 0", False),
        ("0.92 (0.86 to 2.49) s", "<= 1.5", False),
        ("3 m/s", "", False),
    ],
)
def test_missed_aims_are_found(ours: str, aim: str, missed: bool) -> None:  # from the table
    assert table.misses(ours, aim) == missed


def test_missed_aim_is_marked_in_its_row() -> None:
    assert "| ≤ 190 **missed** |" in table.line({"what": "memory", "ours": "193 MB", "aim": "<= 190"})
