"""The assembly encoder interrupt matches the tested C++ decoder, on the emulated chip."""

import struct
import subprocess
from itertools import pairwise

import pytest

from tests.firmware.board.boot import BUILD
from tests.firmware.conftest import BUILD as TEST_BUILD
from tests.firmware.conftest import HERE, build
from thumper.board.messages import BoardModel
from thumper_hil.chip.preemption import Interrupt, symbol
from thumper_hil.chip.wiring import ENCODERS

ELFS = {BoardModel.TREX: BUILD / "thumper.elf", BoardModel.NANO: BUILD / "nano" / "thumper.elf"}
PIN_REGISTERS = {"B": 0x23, "D": 0x29}
WHEELS = {"left_encoder": Interrupt.LEFT_EDGE, "right_encoder": Interrupt.RIGHT_EDGE}


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


@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize("board", ELFS, ids=lambda board: board.name.lower())
def test_the_flashed_interrupt_is_right_from_every_state(board: BoardModel, wheel: str) -> None:
    """Every level and count, every next level: 4 x 65 536 x 4. The interrupt of the flashed image itself."""
    pins = ENCODERS[board][list(WHEELS).index(wheel)]
    program = build(
        TEST_BUILD / "flashed_interrupt",
        ["g++"],
        [HERE / "native/flashed_interrupt.cpp"],
        ["-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror", "-lsimavr"],
    )
    arguments = (
        WHEELS[wheel],
        symbol(ELFS[board], wheel).address,
        PIN_REGISTERS[pins.port],
        1 << pins.a_bit | 1 << pins.b_bit,
    )
    result = subprocess.run(
        [program, ELFS[board], *(str(int(value)) for value in arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stdout) == (0, "1048576\n")
