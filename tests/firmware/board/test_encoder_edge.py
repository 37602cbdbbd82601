"""The assembly encoder interrupt matches the tested C++ decoder, on the emulated chip."""

import struct
from itertools import pairwise


def test_assembly_and_reference_agree_on_random_walks(chip_encoder_walk: bytes) -> None:
    steps = list(struct.iter_unpack("<5H", chip_encoder_walk))

    assert len(steps) == 3 * 6000
    assert all(step[:2] == step[2:4] for step in steps)
    assert all(unchanged for *_, unchanged in steps), "registers and flags must be unchanged"
    for first in range(0, len(steps), 6000):
        walk = steps[first : first + 6000]
        still = sum(old == new for old, new in pairwise(walk))
        assert still > 100, "glitches"
        assert walk[-1][1] > 256, "double edges, with a carry"
        assert len({count >> 8 for count, *_ in walk}) >= 3, "carries in both directions"
        assert max(count for count, *_ in walk) > 0xFF00, "below zero"
