"""Send requests, most of them damaged, over the simulated serial line and collect the answers.

The host's decoder shares no code with the firmware's. It decides which of the damaged frames are still valid.
The board must answer exactly those, in order, and count exactly the others as errors.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass

from thumper.board.framing import FrameDecoder, encode_frame
from thumper.board.messages import (
    Ack,
    Command,
    CommandRequest,
    GetParameter,
    Identify,
    Identity,
    Message,
    ParameterValue,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ, Chip

BURST_BYTES = 24
BURST_CYCLES = 3 * CPU_HZ // 1000
"""A burst fits in the firmware's receive ring, which is not drained while the firmware packs telemetry."""

SETTLE_CYCLES = CPU_HZ // 3
CLEAN_SHARE = 0.25
REQUESTS: tuple[Message, ...] = (
    GetParameter(index=0),
    GetParameter(index=200),
    SetParameter(index=1, value=300),
    SetParameter(index=1, value=-5),
    CommandRequest(command=Command.DISARM),
    SetWheelSpeeds(left=900, right=-900),
    SetMotorPwm(left=0, right=255),
    Identify(),
)
PAYLOAD_LENGTHS = {message.ID: len(message.pack()) for message in REQUESTS}
SILENT = (SetWheelSpeeds.ID, SetMotorPwm.ID)
"""Requests without an answer."""


def flip(bits: int) -> Callable[[random.Random, bytearray], None]:
    """Return a damage function that inverts `bits` bits of a frame."""

    def damage(rng: random.Random, frame: bytearray) -> None:
        for index in rng.sample(range(8 * len(frame)), bits):
            frame[index // 8] ^= 1 << index % 8

    return damage


def drop(rng: random.Random, frame: bytearray) -> None:
    """Remove one byte of a frame."""
    del frame[rng.randrange(len(frame))]


def duplicate(rng: random.Random, frame: bytearray) -> None:
    """Repeat one byte of a frame."""
    index = rng.randrange(len(frame))
    frame.insert(index, frame[index])


def truncate(rng: random.Random, frame: bytearray) -> None:
    """Cut off the end of a frame."""
    del frame[rng.randrange(len(frame)) :]


def scramble(rng: random.Random, frame: bytearray) -> None:
    """Replace a frame by random bytes, up to twice the length of a frame."""
    frame[:] = rng.randbytes(rng.randrange(40)) + b"\x00"


DAMAGES = (flip(1), flip(2), flip(7), drop, duplicate, truncate, scramble)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseResult:
    """Frames sent, answers expected, and answers received."""

    frames: int
    valid: int  # frames that pass the host's decoder
    expected: list[tuple[int, int]]  # (request id, sequence) of each expected answer
    answers: list[tuple[int, int]]
    expected_errors: int
    counted_errors: int  # by the board, modulo 2**16
    host_errors: int  # frames from the board that fail the CRC


def send_damaged_requests(chip: Chip, *, frames: int, seed: int) -> NoiseResult:
    """Send `frames` requests, three quarters of them damaged, and collect the answers."""
    rng = random.Random(seed)
    reference, board = FrameDecoder(), FrameDecoder()
    expected: list[tuple[int, int]] = []
    answers: list[tuple[int, int]] = []
    refused = valid = sent = 0
    while sent < frames:
        burst = bytearray()
        while len(burst) < BURST_BYTES and sent < frames:
            burst += _request(rng, sent)
            sent += 1
        for frame in reference.feed(bytes(burst)):
            valid += 1
            # `identify` may have any length, so that it works between all versions.
            if frame.message_id != Identify.ID and PAYLOAD_LENGTHS.get(frame.message_id) != len(
                frame.payload
            ):
                refused += 1
            elif frame.message_id not in SILENT:
                expected.append((frame.message_id, frame.sequence))
        chip.send(bytes(burst))
        chip.run(chip.cycle + BURST_CYCLES)
        _collect(chip, board, answers)
    chip.send(b"\x00")  # ends a frame whose delimiter was lost
    reference.feed(b"\x00")
    chip.run(chip.cycle + SETTLE_CYCLES)
    counted = _collect(chip, board, answers)
    return NoiseResult(
        frames=frames,
        valid=valid,
        expected=expected,
        answers=answers,
        expected_errors=reference.errors + refused,
        counted_errors=counted,
        host_errors=board.errors,
    )


def _request(rng: random.Random, number: int) -> bytes:
    message = rng.choice(REQUESTS)
    frame = bytearray(encode_frame(message.ID, number % 256, message.pack()))
    if rng.random() > CLEAN_SHARE:
        rng.choice(DAMAGES)(rng, frame)
    return bytes(frame)


def _collect(chip: Chip, decoder: FrameDecoder, answers: list[tuple[int, int]]) -> int:
    """Append the board's answers; return the error count of its last telemetry, or -1 without one."""
    counted = -1
    for frame in decoder.feed(chip.receive(chip.available)):
        if frame.message_id == Ack.ID:
            ack = Ack.unpack(frame.payload)
            answers.append((ack.request_id, ack.request_seq))
        elif frame.message_id == ParameterValue.ID:
            answers.append((GetParameter.ID, frame.sequence))
        elif frame.message_id == Identity.ID:
            answers.append((Identify.ID, frame.sequence))
        elif frame.message_id == Telemetry.ID:
            counted = Telemetry.unpack(frame.payload).rx_errors
    return counted
