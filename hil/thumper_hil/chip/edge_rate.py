"""The highest rate of encoder edges that a firmware counts without loss, found by trying."""

from collections.abc import Callable
from pathlib import Path

from thumper.link.framing import FrameDecoder, encode_frame
from thumper.link.messages import Board, Identify, Telemetry
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.lab import LabChip
from thumper_hil.chip.wiring import ENCODERS

SLICE_CYCLES = CPU_HZ // 200
REQUEST = encode_frame(Identify.ID, 7, Identify().pack())
SETTLE_CYCLES = CPU_HZ // 4
CHUNK_BYTES = 4096
CYCLES_PER_BYTE = 320  # at 500 000 baud
PHASES = (0.0, 0.27, 0.5)
"""How far the right encoder lags behind the left one, in intervals."""


def counts_all(
    elf: Path, interval_cycles: int, *, edges: int, phase: float, line_share: float, board: Board
) -> bool:
    """Drive both encoders, fill `line_share` of the line with requests; true when all edges were counted."""
    chip = LabChip(elf)
    left, right = ENCODERS[board]
    with chip.edges(left) as left_source, chip.edges(right) as right_source:
        chip.run(SETTLE_CYCLES)
        left_source.start(delay_cycles=1000, interval_cycles=interval_cycles, count=edges)
        lag = round(phase * interval_cycles)
        right_source.start(delay_cycles=1000 + lag, interval_cycles=interval_cycles, count=edges)
        end = chip.cycle + 1000 + lag + interval_cycles * edges
        while chip.cycle < end:
            chip.send(REQUEST * round(line_share * SLICE_CYCLES / (CYCLES_PER_BYTE * len(REQUEST))))
            chip.run(chip.cycle + SLICE_CYCLES)
        chip.receive(chip.available)
        chip.run(chip.cycle + SETTLE_CYCLES)
    frames = FrameDecoder().feed(chip.receive(CHUNK_BYTES))
    last = [Telemetry.unpack(frame.payload) for frame in frames if frame.message_id == Telemetry.ID][-1]
    return (last.left_count, last.right_count, last.lost_edges) == (edges, edges, 0)


def shortest_interval(is_lossless: Callable[[int], bool], *, low: int, high: int) -> int:
    """Return the smallest interval [cycles] in (low, high] that loses nothing; `high` must not."""
    if not is_lossless(high):
        raise ValueError(f"edges are lost even at an interval of {high} cycles")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_lossless(middle) else (middle, high)
    return high


def most_edges_per_s(elf: Path, *, line_share: float, edges: int = 20_000, board: Board = Board.TREX) -> int:
    """Return the rate of each encoder [edges/s], both running, at the worst of three phases.

    `line_share`, 0...1: how full the line to the board is of requests; from a third on the line back is full.
    """

    def is_lossless(interval_cycles: int) -> bool:
        return all(
            counts_all(elf, interval_cycles, edges=edges, phase=phase, line_share=line_share, board=board)
            for phase in PHASES
        )

    return CPU_HZ // shortest_interval(is_lossless, low=40, high=640)
