"""No edge is lost at 100 000 edges/s on both wheels at once with a busy line, on either board."""

import pytest

from tests.firmware.board.boot import ELF
from thumper.board.messages import BoardModel
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.edge_rate import BYTE_PHASES, PHASES, counts_all

ELFS = {BoardModel.TREX: ELF, BoardModel.NANO: ELF.parent / "nano" / ELF.name}
EDGES_PER_S = 100_000


@pytest.mark.parametrize("board", list(BoardModel), ids=lambda board: board.name.lower())
@pytest.mark.parametrize("sensors", [False, True], ids=["plain", "sensors"])
@pytest.mark.parametrize("line_share", [0.0, 0.1, 1.0])
def test_no_edge_is_lost_in_any_phase(board: BoardModel, line_share: float, sensors: bool) -> None:
    """The phases of the encoders to each other and to the bytes on the line. Without noise, every run
    repeats."""
    assert all(
        counts_all(
            ELFS[board],
            CPU_HZ // EDGES_PER_S,
            edges=10_000,
            phase=phase,
            byte_phase=byte_phase,
            line_share=line_share,
            board=board,
            sensors=sensors,
        )
        for phase in PHASES
        for byte_phase in BYTE_PHASES
    )


def test_a_rate_beyond_the_chip_loses_edges() -> None:
    """At 250 000 edges/s, 64 cycles per edge remain for both wheels."""
    assert not counts_all(ELF, CPU_HZ // 250_000, edges=2000, line_share=1.0)
