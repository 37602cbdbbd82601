"""Find the highest rate of encoder edges that a firmware counts without loss, by bisection."""

from collections.abc import Callable
from pathlib import Path

from thumper.board.framing import FrameDecoder, encode_frame
from thumper.board.messages import (
    PARAMETERS,
    BoardModel,
    GyroscopeState,
    Identify,
    SetParameter,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ, ChipError
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.wiring import ENCODERS

SLICE_CYCLES = CPU_HZ // 200
REQUEST = encode_frame(Identify.ID, 7, Identify().pack())
ENABLE_SENSORS = b"".join(
    encode_frame(SetParameter.ID, 8, SetParameter(index=spec.index, value=1).pack())
    for spec in PARAMETERS
    if spec.name in {"gyroscope", "tilt_limit"}
)
SETTLE_CYCLES = CPU_HZ // 4
CHUNK_BYTES = 4096
CYCLES_PER_BYTE = 320  # at 500 000 baud
PHASES = (0.0, 0.27, 0.5, 0.73)
"""Lag of the right encoder behind the left one, in intervals."""
BYTE_PHASES = (0.0, 0.31, 0.62)
"""Lag of both encoders behind the bytes on the line, in intervals: 160 cycles divide the 320 of a byte."""


def counts_all(
    elf: Path,
    interval_cycles: int,
    *,
    line_share: float,
    phase: float = 0.0,
    byte_phase: float = 0.0,
    edges: int = 20_000,
    board: BoardModel = BoardModel.TREX,
    sensors: bool = False,
) -> bool:
    """Return True if the firmware counts all edges while requests fill `line_share` of the line.

    `sensors` switches gyroscope and accelerometer on.
    """
    chip = InstrumentedChip(elf)
    left, right = ENCODERS[board]
    with chip.edges(left) as left_source, chip.edges(right) as right_source:
        chip.run(SETTLE_CYCLES)
        if sensors:
            chip.fit_gyroscope()
            chip.send(ENABLE_SENSORS)
            chip.run(3 * SETTLE_CYCLES)
        first = 1000 + round(byte_phase * interval_cycles)
        lag = round(phase * interval_cycles)
        left_source.start(delay_cycles=first, interval_cycles=interval_cycles, count=edges)
        right_source.start(delay_cycles=first + lag, interval_cycles=interval_cycles, count=edges)
        end = chip.cycle + first + lag + interval_cycles * edges
        while chip.cycle < end:
            chip.send(REQUEST * round(line_share * SLICE_CYCLES / (CYCLES_PER_BYTE * len(REQUEST))))
            chip.run(chip.cycle + SLICE_CYCLES)
        chip.receive(chip.available)
        chip.run(chip.cycle + SETTLE_CYCLES)
    frames = FrameDecoder().feed(chip.receive(CHUNK_BYTES))
    last = [Telemetry.unpack(frame.payload) for frame in frames if frame.message_id == Telemetry.ID][-1]
    if sensors and last.gyroscope is not GyroscopeState.CALIBRATING:
        raise ChipError(f"the gyroscope does not measure: {last.gyroscope.name}")
    return (last.left_count, last.right_count, last.lost_edges) == (edges, edges, 0)


def shortest_interval(is_lossless: Callable[[int], bool], *, low: int, high: int) -> int:
    """Return the smallest lossless interval [cycles] in (low, high]; `high` must be lossless."""
    if not is_lossless(high):
        raise ValueError(f"edges are lost even at an interval of {high} cycles")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_lossless(middle) else (middle, high)
    return high


def max_edges_per_s(elf: Path, *, line_share: float, board: BoardModel = BoardModel.TREX) -> int:
    """Return the highest lossless rate per encoder [edges/s], both running, at the worst of 12 phases.

    `line_share`, 0...1, is the load of the line to the board. From one third on, the replies fill the line
    back.
    """

    def is_lossless(interval_cycles: int) -> bool:
        return all(
            counts_all(
                elf, interval_cycles, phase=phase, byte_phase=byte_phase, line_share=line_share, board=board
            )
            for phase in PHASES
            for byte_phase in BYTE_PHASES
        )

    return CPU_HZ // shortest_interval(is_lossless, low=80, high=640)
