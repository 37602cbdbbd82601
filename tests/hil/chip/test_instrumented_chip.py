"""The chip's instruments measure correctly: cycles of known code, EEPROM, flash, HEX files."""

from pathlib import Path

import pytest

from tests.hil.chip.conftest import BuildAvr
from thumper.common.errors import ThumperError
from thumper_hil.chip.chip import CPU_HZ, ChipError
from thumper_hil.chip.hex_file import read_hex
from thumper_hil.chip.instrumented_chip import EEPROM_BYTES, FLASH_BYTES, InstrumentedChip


def test_probe_counts_exact_cycles(build_avr: BuildAvr) -> None:
    """Response 4, jump 3, two instructions, RETI 4 (data sheet 7.7.1 and the instruction set manual)."""
    chip = InstrumentedChip(build_avr("known"))
    chip.run(CPU_HZ // 1000)
    with chip.probe() as probe:
        probe.run(chip.cycle + CPU_HZ // 100)
        report = probe.report()
    tick = report.vector[11]
    assert tick.entries == pytest.approx(100, abs=1)
    assert (tick.least, tick.most) == (13, 13)
    assert report.interrupts_off == 20 + 2 + 1  # the instructions, the jump back, SEI
    assert report.marked_most == 29
    assert abs(report.tick_least - 1600) <= 30
    assert abs(report.tick_most - 1600) <= 30
    assert report.deepest_stack == 4  # the call of main and the interrupt
    assert report.awake == pytest.approx(CPU_HZ // 100, abs=20)


def test_flash_and_eeprom_read_back(build_avr: BuildAvr) -> None:
    chip = InstrumentedChip(build_avr("known"))
    chip.write_flash(0x7000, b"flash")
    chip.write_eeprom(b"eeprom", 1000)
    assert chip.read_flash(0x7000, 5) == b"flash"
    assert chip.eeprom()[1000:1006] == b"eeprom"
    assert len(chip.eeprom()) == EEPROM_BYTES
    for beyond in (
        lambda: chip.write_flash(FLASH_BYTES - 1, b"xy"),
        lambda: chip.read_flash(FLASH_BYTES + 1, 1),
        lambda: chip.write_eeprom(b"xy", EEPROM_BYTES - 1),
    ):
        with pytest.raises(ChipError, match=r"fit in (flash|EEPROM)|past the end of flash"):
            beyond()


def test_hang_at_stops_the_program(build_avr: BuildAvr) -> None:
    """`burst` sends 64 bytes after a reset, unless it hangs at its reset vector."""
    chip = InstrumentedChip(build_avr("burst"))
    chip.hang_at(0)
    chip.reset()
    chip.run(chip.cycle + CPU_HZ // 100)
    assert chip.receive(100) == b""


def test_hex_files_are_read_and_damaged_ones_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "image.hex"
    path.write_text(":0200100001020B\n:02000000AABB99\n".replace("0B", "EB") + ":00000001FF\n")
    start, image = read_hex(path)
    assert (start, image[:2], image[2:16], image[16:]) == (0, b"\xaa\xbb", b"\xff" * 14, b"\x01\x02")
    for text in (":0200100001020C\n", "no hex\n", ":00000001FF\n", ":020000040001F9\n", ":02\n"):
        path.write_text(text)
        with pytest.raises(ThumperError, match=str(path)):
            read_hex(path)
    with pytest.raises(ThumperError, match="missing"):
        read_hex(tmp_path / "missing.hex")
