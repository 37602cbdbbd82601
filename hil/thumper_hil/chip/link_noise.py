"""Requests, most of them damaged on the way, through the simulated serial line; and what must come of them.

The host's own decoder, which shares no line with the firmware's, says which of the damaged frames are still
whole. The board has to answer exactly those, in order, and to count exactly the others.
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
"""Bursts fit the firmware's receive ring, which nobody empties while it packs its telemetry."""

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
LENGTH_OF = {message.ID: len(message.pack()) for message in REQUESTS}
SILENT = (SetWheelSpeeds.ID, SetMotorPwm.ID)
"""Requests that get no answer."""


def flip(bits: int) -> Callable[[random.Random, bytearray], None]:
    """Damage: invert this many bits."""

    def damage(rng: random.Random, frame: bytearray) -> None:
        for place in rng.sample(range(8 * len(frame)), bits):
            frame[place // 8] ^= 1 << place % 8

    return damage


def drop(rng: random.Random, frame: bytearray) -> None:
    """Damage: lose a byte."""
    del frame[rng.randrange(len(frame))]


def double(rng: random.Random, frame: bytearray) -> None:
    """Damage: receive a byte twice."""
    place = rng.randrange(len(frame))
    frame.insert(place, frame[place])


def truncate(rng: random.Random, frame: bytearray) -> None:
    """Damage: lose the end."""
    del frame[rng.randrange(len(frame)) :]


def scramble(rng: random.Random, frame: bytearray) -> None:
    """Damage: random bytes of any length up to twice a frame's."""
    frame[:] = rng.randbytes(rng.randrange(40)) + b"\x00"


DAMAGES = (flip(1), flip(2), flip(7), drop, double, truncate, scramble)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseResult:
    """What was sent, and what the board made of it."""

    frames: int
    whole: int  # frames that the host's decoder found whole
    expected: list[tuple[int, int]]  # (request id, sequence) of each answer that is due
    answers: list[tuple[int, int]]
    expected_errors: int
    counted_errors: int  # by the board, modulo 2**16
    host_errors: int  # frames from the board that did not check


def drive(chip: Chip, *, frames: int, seed: int) -> NoiseResult:
    """Send so many requests, three quarters of them damaged, and collect the answers."""
    rng = random.Random(seed)
    reference, board = FrameDecoder(), FrameDecoder()
    expected: list[tuple[int, int]] = []
    answers: list[tuple[int, int]] = []
    refused = whole = sent = 0
    while sent < frames:
        burst = bytearray()
        while len(burst) < BURST_BYTES and sent < frames:
            burst += _request(rng, sent)
            sent += 1
        for frame in reference.feed(bytes(burst)):
            whole += 1
            # `identify` may be of any length: it must work between all versions.
            if frame.message_id != Identify.ID and LENGTH_OF.get(frame.message_id) != len(frame.payload):
                refused += 1
            elif frame.message_id not in SILENT:
                expected.append((frame.message_id, frame.sequence))
        chip.send(bytes(burst))
        chip.run(chip.cycle + BURST_CYCLES)
        _collect(chip, board, answers)
    chip.send(b"\x00")  # ends what a lost delimiter left open
    reference.feed(b"\x00")
    chip.run(chip.cycle + SETTLE_CYCLES)
    counted = _collect(chip, board, answers)
    return NoiseResult(
        frames=frames,
        whole=whole,
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
    """Sort what the board sent; returns the errors that its last telemetry counted, -1 without one."""
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
