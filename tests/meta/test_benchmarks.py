"""`make bench` runs every benchmark there is, and its page can take their rows."""

from benchmarks.table import BENCHMARKS, HERE, MARK, PAGE


def test_every_benchmark_is_in_the_table() -> None:
    programs = {path.stem for path in HERE.glob("*.py")} - {"figure", "table"}
    assert set(BENCHMARKS) == programs


def test_every_benchmark_tells_its_figures() -> None:
    for name in BENCHMARKS:
        assert "figure(" in (HERE / f"{name}.py").read_text(encoding="utf-8"), name


def test_the_page_keeps_what_is_written_above_its_table() -> None:
    assert PAGE.read_text(encoding="utf-8").count(MARK) == 1
