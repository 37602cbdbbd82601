"""The core stays pure, compiles for other chips, and the Makefile rebuilds what has changed."""

import re
import subprocess
from pathlib import Path

import pytest
from benchmarks.firmware import size_of, size_without

from tests.firmware.board.boot import ELF

FIRMWARE = Path(__file__).parents[3] / "firmware"


def make(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["make", "-C", str(FIRMWARE), *arguments], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("header", sorted((FIRMWARE / "core").glob("*.hpp")), ids=lambda path: path.name)
def test_core_includes_nothing_but_itself_and_fixed_width_types(header: Path) -> None:
    included = re.findall(r"#include\s+(\S+)", header.read_text())
    allowed = {"<stdint.h>", "<stddef.h>", *(f'"core/{p.name}"' for p in (FIRMWARE / "core").glob("*.hpp"))}
    assert set(included) <= allowed


@pytest.mark.parametrize("header", sorted((FIRMWARE / "core").glob("*.hpp")), ids=lambda path: path.name)
def test_every_core_header_compiles_alone(header: Path, tmp_path: Path) -> None:
    source = tmp_path / "alone.cpp"
    source.write_text(f'#include "core/{header.name}"\n')
    command = [
        "g++",
        "-std=c++14",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-fsyntax-only",
        f"-I{FIRMWARE}",
        str(source),
    ]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("folder", ["app", "board"])
def test_no_register_is_a_template_argument(folder: str) -> None:
    """gcc 7, which PlatformIO ships, rejects a register address as a constant there; gcc 5 accepts it."""
    for source in (FIRMWARE / folder).glob("*.[ch]pp"):
        assert not re.search(r"<[^<>;]*_SFR_(IO|MEM)_ADDR", source.read_text()), source


def test_the_gyroscope_needs_at_most_900_bytes_of_flash() -> None:
    assert 500 < size_of(ELF)[0] - size_without("gyroscope")[0] <= 900


def test_changed_options_rebuild_and_the_same_options_do_not(tmp_path: Path) -> None:
    def build_with(*options: str) -> tuple[bytes, bool]:
        before = (tmp_path / "thumper.elf").stat().st_mtime_ns if (tmp_path / "thumper.elf").exists() else 0
        assert make(f"BUILD={tmp_path}", *options).returncode == 0
        return (tmp_path / "thumper.hex").read_bytes(), (tmp_path / "thumper.elf").stat().st_mtime_ns > before

    ten, _ = build_with()
    assert build_with() == (ten, False)
    fifty, rebuilt = build_with("RATE=50")
    assert rebuilt
    assert fifty != ten
    assert build_with("RATE=50", "BAUD=250000")[1]
    assert build_with() == (ten, True)


def test_a_baud_rate_off_by_two_percent_is_refused(tmp_path: Path) -> None:
    result = make("BAUD=115200", f"BUILD={tmp_path}")
    assert result.returncode != 0
    assert "UART baud rate is off by more than 1 %" in result.stderr


@pytest.mark.parametrize(("rate", "baud"), [(100, 38_400), (100, 76_923), (50, 38_400)])
def test_a_line_too_slow_for_the_control_rate_is_refused(tmp_path: Path, rate: int, baud: int) -> None:
    result = make(f"RATE={rate}", f"BAUD={baud}", f"BUILD={tmp_path}")
    assert result.returncode != 0
    assert "telemetry takes more than half of the line" in result.stderr


def test_a_line_just_fast_enough_is_accepted(tmp_path: Path) -> None:
    assert make("RATE=20", "BAUD=38400", f"BUILD={tmp_path}").returncode == 0
