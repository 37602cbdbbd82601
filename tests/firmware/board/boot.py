"""Boot loaders from Debian's arduino-core-avr, and chips that contain one."""

import os
import subprocess
from pathlib import Path

from thumper_hil.chip.instrumented_chip import ATMEGABOOT, InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

ROOT = Path(__file__).resolve().parents[3]
BOOTLOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders")
BROKEN_OPTIBOOT = BOOTLOADERS / "optiboot/optiboot_atmega328.hex"
"""Debian's build of it has 534 bytes, but the chip has only 512 for it."""

BUILD = Path(os.environ.get("THUMPER_FIRMWARE", ROOT / "firmware" / "build"))
"""THUMPER_FIRMWARE names a directory with another build to test, such as one of another compiler."""
ELF = BUILD / "thumper.elf"
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


def compiler_of(elf: Path) -> str:
    """Return the version of the compiler that made an ELF, such as 5.4.0."""
    text = subprocess.run(["avr-readelf", "-p", ".comment", elf], capture_output=True, text=True, check=True)
    return text.stdout.rstrip().rsplit(maxsplit=1)[-1]
