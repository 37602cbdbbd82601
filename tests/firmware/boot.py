"""The boot loaders that Debian's arduino-core-avr brings, and a chip that has one."""

from pathlib import Path

from thumper_hil.chip.lab import LabChip

ROOT = Path(__file__).resolve().parents[2]
BOOTLOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders")
ATMEGABOOT = BOOTLOADERS / "atmega/ATmegaBOOT_168_atmega328.hex"
"""What is on the T'REX and on most Nanos; 57600 baud, from 0x7800 on."""

BROKEN_OPTIBOOT = BOOTLOADERS / "optiboot/optiboot_atmega328.hex"
"""Debian's build of it is 534 bytes long; the chip has 512 for it."""

ELF = ROOT / "firmware" / "build" / "thumper.elf"
HEX = ELF.with_suffix(".hex")
BOOT_S = 2.0
"""The boot loader waits 1.3 s for a programmer before it starts the program."""


def chip_with_bootloader() -> LabChip:
    """A chip as it comes from the shop: the boot loader and nothing else."""
    chip = LabChip(ELF)
    chip.install_bootloader(ATMEGABOOT)
    return chip
