"""The boot loaders that Debian's arduino-core-avr brings, and a chip that has one."""

from pathlib import Path

from thumper_hil.chip.instrumented_chip import ATMEGABOOT, InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

ROOT = Path(__file__).resolve().parents[2]
BOOTLOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders")
BROKEN_OPTIBOOT = BOOTLOADERS / "optiboot/optiboot_atmega328.hex"
"""Debian's build of it is 534 bytes long; the chip has 512 for it."""

ELF = ROOT / "firmware" / "build" / "thumper.elf"
HEX = ELF.with_suffix(".hex")


def chip_with_bootloader() -> InstrumentedChip:
    """A chip as it comes from the shop: the boot loader and nothing else."""
    chip = InstrumentedChip(ELF)
    chip.install_bootloader(ATMEGABOOT)
    return chip


def chip_with_program(elf: Path, params: RobotParams | None = None) -> InstrumentedChip:
    """A chip with the boot loader and a program, just reset; with `params` on a robot."""
    chip = InstrumentedChip(elf, params=params)
    chip.add_bootloader(ATMEGABOOT)
    return chip
