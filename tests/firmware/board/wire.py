"""Exchanges frames with a chip that has no robot and no port."""

from thumper.board.framing import Frame, FrameDecoder, encode_frame
from thumper.board.messages import Fault, Identify, Identity, Message, Telemetry
from thumper_hil.chip.chip import CPU_HZ, Chip

ANSWER_S = 0.02


def run_for(chip: Chip, seconds: float) -> None:
    """Run for `seconds`."""
    chip.run(chip.cycle + round(seconds * CPU_HZ))


def send(chip: Chip, message: Message, sequence: int = 1) -> None:
    """Send a frame to the chip, with a delimiter before it."""
    chip.send(b"\x00" + encode_frame(message.ID, sequence, message.pack()))


def frames(chip: Chip) -> list[Frame]:
    """Return the received frames; drop a frame that was cut off before the first delimiter."""
    return FrameDecoder().feed(chip.receive(chip.available))


def ask(chip: Chip, message: Message, answer: type[Message], wait_s: float = ANSWER_S) -> Frame | None:
    """Send a request and return the frame that answers it, or None."""
    chip.receive(chip.available)
    send(chip, message)
    run_for(chip, wait_s)
    return next((frame for frame in frames(chip) if frame.message_id == answer.ID), None)


def identity(chip: Chip) -> Identity | None:
    """Request the identity; return None without an answer."""
    frame = ask(chip, Identify(), Identity)
    return Identity.unpack(frame.payload) if frame else None


def first_fault(seen: list[Telemetry]) -> tuple[Fault, int]:
    """Return the first fault in telemetry, and its time [us] after the tick that first drove a motor."""
    driven_us = next(sample.time_us for sample in seen if sample.left_pwm != 0 or sample.right_pwm != 0)
    found = next((sample for sample in seen if sample.fault is not Fault.NONE), seen[-1])
    return found.fault, found.time_us - driven_us
