"""Boot loaders from Debian's arduino-core-avr, and chips that contain one."""

from pathlib import Path

from thumper_hil.chip.instrumented_chip import ATMEGABOOT, InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

ROOT = Path(__file__).resolve().parents[3]
BOOTLOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders")
BROKEN_OPTIBOOT = BOOTLOADERS / "optiboot/optiboot_atmega328.hex"
"""Debian's build of it has 534 bytes, but the chip has only 512 for it."""

ELF = ROOT / "firmware" / "build" / "thumper.elf"
HEX = ELF.with_suffix(".hex")


def chip_with_bootloader() -> InstrumentedChip:
    """Return a factory-fresh chip: it contains only the boot loader."""
    chip = InstrumentedChip(ELF)
    chip.install_bootloader(ATMEGABOOT)
    return chip


def chip_with_program(elf: Path, params: RobotParams | None = None) -> InstrumentedChip:
    """Return a chip with boot loader and program, just reset; with `params`, on a robot."""
    chip = InstrumentedChip(elf, params=params)
    chip.add_bootloader(ATMEGABOOT)
    return chip
