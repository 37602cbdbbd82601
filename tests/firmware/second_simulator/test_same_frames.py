"""The flashed HEX on avr8js, another simulator of the chip, sends the same bytes as on simavr.

The two share no code. Both get requests, damaged bytes and encoder edges at the same clock cycles. Edges come
at phases at which no tick reads the counts, because the simulators' ticks differ by a few cycles.
"""

from tests.firmware.board.boot import ELF, HEX
from tests.firmware.second_simulator.node import run_script
from thumper.board.framing import Frame, FrameDecoder, encode_frame
from thumper.board.messages import (
    PARAMETERS,
    BoardModel,
    Command,
    CommandRequest,
    GetParameter,
    Identify,
    Message,
    SetParameter,
    SetWheelSpeeds,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.wiring import ENCODERS, EncoderPins

RUN_S = 6.5
EDGES_FROM_S = 0.2
EDGES = 20_000
BYTE_CYCLES = 330
"""From one byte to the next. A byte takes 320, and avr8js drops one that begins earlier."""

WHEELS = tuple(zip(ENCODERS[BoardModel.TREX], (20_800, 21_500), (1600, 2000), strict=True))
"""Pins of each encoder, cycles until its first edge, cycles between two."""

Event = tuple[int, str, int, int]


def frame(message: Message) -> bytes:
    """Return a frame with a delimiter before it."""
    return b"\0" + encode_frame(message.ID, 7, message.pack())


def requests() -> dict[float, bytes]:
    """Return the bytes to send, by the time of the first."""
    settings = [SetParameter(index=s.index, value=round(s.maximum * s.scale)) for s in PARAMETERS[:3]]
    return {
        0.22: frame(Identify()) + b"".join(frame(GetParameter(index=s.index)) for s in PARAMETERS),
        1.22: b"".join(map(frame, settings)) + frame(GetParameter(index=0)),
        2.22: frame(CommandRequest(command=Command.ARM)) + frame(SetWheelSpeeds(left=5000, right=5000)),
        3.22: b"\x00\x07noise\x00\xff\xff\x00" + frame(CommandRequest(command=Command.E_STOP)),
        4.22: frame(CommandRequest(command=Command.RESTORE_DEFAULTS)) + frame(GetParameter(index=0)),
    }


def edges(pins: EncoderPins, first: int, interval: int) -> list[Event]:
    """Return the forward edges of an encoder, A first; both channels begin low."""
    events: list[Event] = [(0, pins.port, pins.a_bit, 0), (0, pins.port, pins.b_bit, 0)]
    for number in range(EDGES):
        is_a = number % 2 == 0
        cycle = round(EDGES_FROM_S * CPU_HZ) + first + number * interval
        events.append((cycle, pins.port, pins.a_bit if is_a else pins.b_bit, int(number % 4 < 2)))
    return events


def on_avr8js() -> list[Frame]:
    """Return the frames that the HEX sends on avr8js."""
    events = [event for wheel in WHEELS for event in edges(*wheel)]
    for start_s, data in requests().items():
        for number, byte in enumerate(data):
            events.append((round(start_s * CPU_HZ) + number * BYTE_CYCLES, "byte", byte, 0))
    job = {"hex": HEX.read_text("ascii"), "until": round(RUN_S * CPU_HZ), "events": sorted(events)}
    return FrameDecoder().feed(bytes.fromhex(run_script("same_frames.mjs", job)))


def on_simavr() -> list[Frame]:
    """Return the frames that the ELF sends on the simulated chip."""
    chip = InstrumentedChip(ELF)
    left, right = WHEELS
    with chip.edges(left[0]) as left_source, chip.edges(right[0]) as right_source:
        chip.run(round(EDGES_FROM_S * CPU_HZ))
        for source, (_, first, interval) in zip((left_source, right_source), WHEELS, strict=True):
            source.start(delay_cycles=first, interval_cycles=interval, count=EDGES)
        for start_s, data in requests().items():
            chip.run(round(start_s * CPU_HZ))
            chip.send(data)
        chip.run(round(RUN_S * CPU_HZ))
    return FrameDecoder().feed(chip.receive(chip.available))


def test_every_frame_is_equal() -> None:
    theirs, ours = on_avr8js(), on_simavr()
    assert len(ours) == 73 + len(PARAMETERS)
    assert theirs == ours
