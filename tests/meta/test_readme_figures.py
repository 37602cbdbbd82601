"""The README's comparison has the figures of the benchmarks' page."""

import re
from pathlib import Path

import pytest
from benchmarks import table

README = Path(__file__).parents[2] / "README.md"
OTHERS = {"ros_arduino_bridge": "bridge", "rosserial": "rosserial", "linorobot": "linorobot"}


def cells(benchmark: str, what: str) -> list[str]:
    """Return the cells of a row: what, ours, aim, others, load."""
    (row,) = [row for row in table.read_rows()[benchmark] if row.startswith(f"| {what} |")]
    return [cell.strip() for cell in row.strip("|").split("|")]


def comparison(program: str, columns: int) -> list[str]:
    """Return the figures of a program in the README's table with so many columns."""
    text = README.read_text("utf-8").partition("## Compared with other projects")[2]
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith(f"| {program}")]
    (row,) = [row for row in rows if len(row) == columns]
    return [cell.strip() for cell in row[1:]]


def test_firmware() -> None:
    flash, sram = cells("firmware", "flash"), cells("firmware", "static SRAM")
    edges = table.numbers(cells("firmware", "lossless edges/s, line full both ways")[1])[0]
    ours = [f"{table.numbers(flash[1])[0] / 1000:.1f} kB", sram[1], f"{edges / 1000:.0f} 000"]
    assert comparison("Thumper", columns=4) == ours
    for name, short in OTHERS.items():
        (flash_bytes,), (sram_bytes,) = (re.findall(rf"\b{short} (\d+)", row[3]) for row in (flash, sram))
        assert comparison(name, columns=4)[:2] == [
            f"{int(flash_bytes) / 1000:.1f} kB",
            f"{sram_bytes} bytes",
        ]


@pytest.mark.parametrize(
    ("program", "benchmark", "what", "text"),
    [
        ("Thumper |", "navigation", "the robot's loop in the demo, navigation: share of a core", "{:.3f}"),
        ("Thumper, `slam`", "slam", "slam, Intel: path error", "{:.3f} m"),
        ("Thumper, `slam`", "slam", "scan_match, Intel: path error", "{:.3f} m"),
    ],
)
def test_navigation_and_map(program: str, benchmark: str, what: str, text: str) -> None:
    """The map's errors have the decimals of the others'."""
    ours = comparison(program, columns=3)
    row = next(row for row in table.read_rows()[benchmark] if row.startswith(f"| {what} |"))
    assert text.format(table.numbers(row.split("|")[2])[0]) == ours[0]
