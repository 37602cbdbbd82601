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


def comparison(start: str) -> tuple[str, str]:
    """Return what the README's row says of Thumper and of others."""
    found = re.search(
        rf"(?m)^\| {re.escape(start)}[^|]* \| ([^|]*) \| ([^|]*) \|$", README.read_text("utf-8")
    )
    assert found, start
    return found[1], found[2]


def test_size_of_the_firmware() -> None:
    ours, others = comparison("[firmware](docs/results/benchmarks/firmware.md): flash, static SRAM")
    flash, sram = cells("firmware", "flash"), cells("firmware", "static SRAM")
    assert ours == f"{table.numbers(flash[1])[0] / 1000:.1f} kB, {sram[1]}"
    for name, short in OTHERS.items():
        (flash_bytes,), (sram_bytes,) = (re.findall(rf"\b{short} (\d+)", row[3]) for row in (flash, sram))
        assert f"{name} {int(flash_bytes) / 1000:.1f} kB, {sram_bytes} bytes" in others


def test_encoder_edges() -> None:
    ours, _ = comparison("encoder edges per second without a loss")
    edges = table.numbers(cells("firmware", "lossless edges/s, line full both ways")[1])[0]
    assert ours == f"{edges / 1000:.0f} 000"


@pytest.mark.parametrize(
    ("start", "benchmark", "what", "text"),
    [
        (
            "[navigation](",
            "navigation",
            "the robot's loop in the demo, navigation: share of a core",
            "{:.3f} in the demo",
        ),
        ("[map, Intel", "slam", "slam, Intel: path error", "(`scan_match`): {:.3f} m"),
        ("[map, Intel", "slam", "scan_match, Intel: path error", "(`scan_match`): {:.3f} m"),
    ],
)
def test_navigation_and_map(start: str, benchmark: str, what: str, text: str) -> None:
    """The map's errors have the decimals of the others'."""
    ours, _ = comparison(start)
    row = next(row for row in table.read_rows()[benchmark] if row.startswith(f"| {what} |"))
    assert text.format(table.numbers(row.split("|")[2])[0]) in ours
