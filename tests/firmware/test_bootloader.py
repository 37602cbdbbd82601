"""The stock boot loader and the watchdog, on the emulated chip: what a reset leads to, and what it cannot."""

from tests.firmware.boot import ELF, chip_with_program
from thumper.link.framing import FrameDecoder, encode_frame
from thumper.link.messages import Identify, Identity, ResetCause
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.lab import LabChip

BOOT_S = 1.33
"""From the reset to the program's start, with ATmegaBOOT."""


def run_for(chip: LabChip, seconds: float) -> None:
    """Let `seconds` pass."""
    chip.run(chip.cycle + round(seconds * CPU_HZ))


def identity(chip: LabChip) -> Identity | None:
    """Ask who is there; None when nobody answers within 20 ms."""
    chip.receive(chip.available)
    chip.send(b"\x00" + encode_frame(Identify.ID, 1, Identify().pack()))
    run_for(chip, 0.02)
    for frame in FrameDecoder().feed(chip.receive(chip.available)):
        if frame.message_id == Identity.ID:
            return Identity.unpack(frame.payload)
    return None


def test_the_boot_loader_starts_the_firmware() -> None:
    """A little more than a second after the reset, and the firmware still learns why it was."""
    chip = chip_with_program(ELF)
    run_for(chip, 0.9 * BOOT_S)
    assert identity(chip) is None
    run_for(chip, 0.3 * BOOT_S)
    answer = identity(chip)
    assert answer is not None
    assert answer.reset_cause is ResetCause.EXTERNAL
    assert chip.resets == 1
