"""The serial port's interrupts in assembler do what rings in C++ do, on the emulated chip."""

import struct


def test_assembler_and_reference_agree_on_random_traffic(chip_uart_walk: bytes) -> None:
    steps = list(struct.iter_unpack("<5B", chip_uart_walk))
    taken, received, sent = ([step for step in steps if step[0] == kind] for kind in (0, 1, 2))

    assert len(received) + len(taken) == 6000
    assert len(sent) == 63
    assert all(here == there for _, here, there, _, _ in steps)
    assert all(whole for *_, whole, _ in steps), "registers and flags are as they were"
    assert all(right for *_, right in steps)
