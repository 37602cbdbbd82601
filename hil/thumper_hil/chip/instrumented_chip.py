"""A chip with lab instruments: flash and EEPROM access, an encoder signal generator, a cycle counter."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from thumper_hil.chip.chip import Chip, ChipError
from thumper_hil.chip.hex_file import read_hex
from thumper_hil.chip.native_library import CProbeReport
from thumper_hil.chip.wiring import EncoderPins

FLASH_BYTES = 0x8000
EEPROM_BYTES = 1024
RJMP_SELF = bytes((0xFF, 0xCF))
"""`rjmp .-2`, an instruction that jumps to itself."""

ATMEGABOOT = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders/atmega/ATmegaBOOT_168_atmega328.hex")
"""Boot loader of the T'REX and most Nanos, from Debian's arduino-core-avr; 57600 baud."""

BURSTS = 4096
TICK_VECTOR = 11
"""TIMER1_COMPA, the control tick (ATmega328P data sheet, table 11-6)."""


class InstrumentedChip(Chip):
    """The simulated chip with a programmer, a signal generator and a logic analyser attached."""

    def write_flash(self, address: int, data: bytes) -> None:
        """Overwrite flash; a running program sees the change at once."""
        if not self._library.thumper_write_flash(self._handle, address, data, len(data)):
            raise ChipError(f"{len(data)} bytes at 0x{address:04x} do not fit in flash")

    def read_flash(self, address: int, count: int) -> bytes:
        """Return `count` bytes of flash."""
        data = ctypes.create_string_buffer(count)
        if not self._library.thumper_read_flash(self._handle, address, data, count):
            raise ChipError(f"{count} bytes at 0x{address:04x} reach past the end of flash")
        return data.raw

    def poke(self, address: int, byte: int) -> None:
        """Overwrite one byte of the data space, without the effects of a write by the program."""
        self._library.thumper_poke(self._handle, address, byte)

    def eeprom(self) -> bytes:
        """Return the whole EEPROM."""
        data = ctypes.create_string_buffer(EEPROM_BYTES)
        self._library.thumper_read_eeprom(self._handle, 0, data, EEPROM_BYTES)
        return data.raw

    def write_eeprom(self, data: bytes, address: int = 0) -> None:
        """Overwrite EEPROM from `address` on."""
        if not self._library.thumper_write_eeprom(self._handle, address, data, len(data)):
            raise ChipError(f"{len(data)} bytes at {address} do not fit in EEPROM")

    def install_bootloader(self, hex_path: Path) -> None:
        """Erase the flash, program a boot loader, set the fuses to start in it, and reset.

        Raises
        ------
        ChipError
            The image runs past the end of the flash.
        """
        start, image = read_hex(hex_path)
        if start + len(image) > FLASH_BYTES:
            raise ChipError(
                f"{hex_path}: {len(image)} bytes from 0x{start:04x} on reach past the end of flash"
            )
        self.write_flash(0, b"\xff" * FLASH_BYTES)
        self.write_flash(start, image)
        self._library.thumper_start_at(self._handle, start)
        self.reset()

    def add_bootloader(self, hex_path: Path) -> None:
        """Program a boot loader behind the current program, set the fuses to start in it, and reset.

        Raises
        ------
        ChipError
            As `install_bootloader`.
        """
        program = self.read_flash(0, FLASH_BYTES)
        self.install_bootloader(hex_path)
        start, _ = read_hex(hex_path)
        self.write_flash(0, program[:start])

    def hang_at(self, address: int) -> None:
        """Make the program loop forever at this flash address, to simulate a hang."""
        self.write_flash(address, RJMP_SELF)

    @contextmanager
    def edges(self, pins: EncoderPins) -> Iterator["EdgeSource"]:
        """Drive a pair of encoder pins inside the block; needs a chip without `params`."""
        handle = self._library.thumper_edges_open(self._handle, pins.port.encode(), pins.a_bit, pins.b_bit)
        try:
            yield EdgeSource(self._library, handle)
        finally:
            self._library.thumper_edges_close(handle)

    @contextmanager
    def probe(self, tick_vector: int = TICK_VECTOR) -> Iterator["Probe"]:
        """Trace every instruction inside the block; advance time only with the probe's `run`."""
        handle = self._library.thumper_probe_open(self._handle, tick_vector)
        try:
            yield Probe(self._library, handle)
        finally:
            self._library.thumper_probe_close(handle)


class EdgeSource:
    """An ideal encoder that turns forward."""

    def __init__(self, library: ctypes.CDLL, handle: int) -> None:
        self._library, self._handle = library, handle

    def start(self, *, delay_cycles: int, interval_cycles: int, count: int) -> None:
        """Send `count` edges at a constant interval, the first after `delay_cycles`."""
        self._library.thumper_edges_start(self._handle, delay_cycles, interval_cycles, count)


class Probe:
    """Count the cycles of a running chip."""

    def __init__(self, library: ctypes.CDLL, handle: int) -> None:
        self._library, self._handle = library, handle

    def run(self, until_cycle: int) -> None:
        """Run instruction by instruction until a cycle; raise `ChipError` if the firmware crashes."""
        if not self._library.thumper_probe_run(self._handle, until_cycle):
            raise ChipError("the firmware crashed during the measurement")

    def report(self) -> CProbeReport:
        """Return the counts so far."""
        report = CProbeReport()
        self._library.thumper_probe_report(self._handle, ctypes.byref(report))
        return report

    def tick_bursts(self) -> list[int]:
        """Return the main loop's cycles from wake-up to sleep, for each period that contains a tick."""
        cycles = (ctypes.c_uint64 * BURSTS)()
        return list(cycles[: self._library.thumper_probe_bursts(self._handle, cycles, BURSTS)])
