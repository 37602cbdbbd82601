"""Talk to a chip without a robot or a port: frames in, frames out."""

from thumper.board.framing import Frame, FrameDecoder, encode_frame
from thumper.board.messages import Identify, Identity, Message
from thumper_hil.chip.chip import CPU_HZ, Chip

ANSWER_S = 0.02


def run_for(chip: Chip, seconds: float) -> None:
    """Let `seconds` pass."""
    chip.run(chip.cycle + round(seconds * CPU_HZ))


def send(chip: Chip, message: Message, sequence: int = 1) -> None:
    """Queue a frame to the chip, behind a delimiter."""
    chip.send(b"\x00" + encode_frame(message.ID, sequence, message.pack()))


def frames(chip: Chip) -> list[Frame]:
    """Fetch what has come; a frame that was cut off before the first delimiter is dropped."""
    return FrameDecoder().feed(chip.receive(chip.available))


def ask(chip: Chip, message: Message, answer: type[Message], wait_s: float = ANSWER_S) -> Frame | None:
    """Send a request and return the frame that answers it, or None."""
    chip.receive(chip.available)
    send(chip, message)
    run_for(chip, wait_s)
    return next((frame for frame in frames(chip) if frame.message_id == answer.ID), None)


def identity(chip: Chip) -> Identity | None:
    """Ask who is there; None when nobody answers."""
    frame = ask(chip, Identify(), Identity)
    return Identity.unpack(frame.payload) if frame else None
