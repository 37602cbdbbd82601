"""Chip and host build compute the same, bit for bit, although `int` has 16 bits there and 32 here."""

import ctypes

from thumper.board.messages import Fault


def test_chip_and_host_build_agree_bit_for_bit(core: ctypes.CDLL, chip_vectors: bytes) -> None:
    words = (ctypes.c_int32 * 100_000)()
    size = core.vectors_run(words, len(words))

    assert size == 3000 * 2 + 3000 * 4 + 1000 * 9 + 4000 * 2 + 1 + 4000
    assert len(set(words[:size])) > 3000, "the vectors exercise too little"
    assert set(words[size - 4000 : size]) == {Fault.NONE, Fault.TILTED, Fault.IMPACT}
    assert chip_vectors == bytes(words)[: 4 * size]
