"""The simulated serial line has real timing: ten bits per byte, and a receiver that can overrun."""

import numpy as np

from tests.hil.chip.conftest import BuildAvr
from tests.hil.chip.rig import run_for
from thumper_hil.chip.chip import Chip
from thumper_hil.chip.chip_faults import FaultyChip

BYTE_CYCLES = 320  # ten bits at 500 000 baud
BURST = 64


def test_sent_byte_takes_ten_bits(build_avr: BuildAvr) -> None:
    """simavr alone takes eleven bits: 352 cycles."""
    chip = Chip(build_avr("burst"))
    run_for(chip, 0.01)
    data, cycles = chip.receive_stamped(BURST)
    assert data == bytes(range(BURST))
    spacing = np.diff(cycles)
    assert spacing.min() >= BYTE_CYCLES
    assert spacing.max() <= BYTE_CYCLES + 16  # the polling loop's own time


def test_received_byte_takes_ten_bits(build_avr: BuildAvr) -> None:
    """500 bytes at line rate are echoed at line rate without a loss."""
    chip = Chip(build_avr("burst"))
    run_for(chip, 0.01)
    chip.receive(BURST)
    sent = bytes(i % 251 for i in range(500))
    start = chip.cycle
    chip.send(sent)
    run_for(chip, 0.02)
    data, cycles = chip.receive_stamped(1000)
    assert data == sent
    assert chip.overruns == 0
    first_echo = cycles[0] - start
    assert 2 * BYTE_CYCLES <= first_echo <= 2 * BYTE_CYCLES + 100  # there and back
    assert abs((cycles[-1] - cycles[0]) - 499 * BYTE_CYCLES) <= 200


def test_unread_receiver_overruns(build_avr: BuildAvr) -> None:
    """The chip buffers two bytes and shifts in a third; simavr alone buffers 63."""
    chip = Chip(build_avr("deaf"))
    run_for(chip, 0.001)
    chip.send(bytes(10))
    run_for(chip, 0.005)
    count, overrun = chip.receive(2)
    assert count == 4  # the byte it read, and three buffered ones
    assert overrun != 0
    assert chip.overruns == 6


def test_receiver_catches_up_after_a_pause(build_avr: BuildAvr) -> None:
    """With interrupts off for 2.2 byte times, repeatedly at line rate, all waiting bytes are read in time."""
    chip = Chip(build_avr("pause"))
    run_for(chip, 0.001)
    chip.send(bytes(1000))
    run_for(chip, 0.03)
    assert chip.overruns == 0
    assert int.from_bytes(chip.receive(2), "little") == 1000


def test_wrong_baud_rate_gives_garbage_both_ways(build_avr: BuildAvr) -> None:
    chip = Chip(build_avr("burst"))
    chip.set_host_baud(115_200)
    run_for(chip, 0.01)
    data = chip.receive(BURST)
    assert len(data) == BURST
    assert data != bytes(range(BURST))
    chip.set_host_baud(0)
    chip.send(b"x")
    run_for(chip, 0.001)
    assert chip.receive(10) == b"x"


def test_byte_arrives_after_its_stop_bit(build_avr: BuildAvr) -> None:
    """A byte is available after its stop bit, not when the chip writes it."""
    chip = Chip(build_avr("burst"))
    chip.run(BYTE_CYCLES)
    assert chip.available == 0
    chip.run(2 * BYTE_CYCLES)
    assert chip.available == 1


def test_line_noise_depends_on_the_seed(build_avr: BuildAvr) -> None:
    """With half of the bytes wrong, the same seed gives the same errors and another seed does not."""

    def received(seed: int) -> bytes:
        chip = FaultyChip(build_avr("burst"), seed=seed)
        chip.set_line_noise(loss=0.0, flip=0.5)
        run_for(chip, 0.01)
        return chip.receive(BURST)

    first = received(1)
    assert len(first) == BURST
    assert received(1) == first
    assert received(2) != first
