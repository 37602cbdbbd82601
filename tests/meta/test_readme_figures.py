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


def comparison(program: str, first: str) -> list[str]:
    """Return the figures of a program in the README's table whose first heading is `first`."""
    text = README.read_text("utf-8").partition("## Compared with other projects")[2]
    rows = text.partition(f"| {first} |")[2].partition("\n\n")[0].splitlines()
    (row,) = [row for row in rows if row.startswith(f"| {program}")]
    return [cell.strip() for cell in row.strip("|").split("|")[1:]]


def test_firmware() -> None:
    flash, sram = cells("firmware", "flash"), cells("firmware", "static SRAM")
    edges = table.numbers(cells("firmware", "lossless edges/s, line full both ways")[1])[0]
    ours = [f"{table.numbers(flash[1])[0] / 1000:.1f} kB", sram[1], f"{edges / 1000:.0f} 000"]
    assert comparison("Thumper", "firmware") == ours
    for name, short in OTHERS.items():
        (flash_bytes,), (sram_bytes,) = (re.findall(rf"\b{short} (\d+)", row[3]) for row in (flash, sram))
        assert comparison(name, "firmware")[:2] == [
            f"{int(flash_bytes) / 1000:.1f} kB",
            f"{sram_bytes} bytes",
        ]


@pytest.mark.parametrize(
    ("program", "other"),
    [
        ("Thumper", ""),
        ("LaMa", "LaMa single hypothesis, gate 0.1"),
        ("gmapping", "gmapping, 30 particles"),
        ("open_karto", "open_karto, gate 0.2"),
    ],
)
@pytest.mark.parametrize("method", ["slam", "scan_match"])
def test_map(method: str, program: str, other: str) -> None:
    rows = [row.split("|") for row in table.read_rows()["slam"] if row.startswith(f"| {method}, Intel: ")]
    figures = []
    for what, unit in (("online error", "m"), ("path error", "m"), ("path error", "deg")):
        (row,) = [row for row in rows if row[1].endswith(f": {what} ") and row[2].endswith(f" {unit} ")]
        found = re.search(rf"{re.escape(other)}: ([\d.]+)", row[4]) if other else None
        figures.append(float(found[1]) if found else table.numbers(row[2])[0])
    online, position, heading = comparison(program, "mapper")
    assert [f"{figures[0]:.2g} m", f"{figures[1]:.3f} m", f"{figures[2]:.2f}°"] == [online, position, heading]


def test_navigation() -> None:
    page = (README.parent / "docs/results/navigation.md").read_text("utf-8")
    (row,) = [line for line in page.splitlines() if line.startswith("| share of a core in BARN's worlds")]
    for program, cell in zip(("Thumper", "ROS 1 move_base"), row.split("|")[2:4], strict=True):
        least, greatest = table.numbers(cell)
        assert comparison(program, "navigation") == [f"{least:g} … {greatest:g} %"]
