"""The serial port's assembly interrupts match ring buffers in C++, on the emulated chip."""

import struct


def test_assembly_and_reference_agree_on_random_traffic(chip_uart_walk: bytes) -> None:
    steps = list(struct.iter_unpack("<5B", chip_uart_walk))
    taken, received, sent = ([step for step in steps if step[0] == kind] for kind in (0, 1, 2))

    assert len(received) + len(taken) == 6000
    assert len(sent) == 63
    assert all(here == there for _, here, there, _, _ in steps)
    assert all(unchanged for *_, unchanged, _ in steps), "registers and flags must be unchanged"
    assert all(right for *_, right in steps)
