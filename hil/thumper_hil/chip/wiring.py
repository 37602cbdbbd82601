"""Encoder pins of each board, for tests that drive them directly (see chip/native/wiring.hpp)."""

from dataclasses import dataclass

from thumper.board.messages import BoardModel


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderPins:
    """Port letter and the bits of channels A and B."""

    port: str
    a_bit: int
    b_bit: int


ENCODERS: dict[BoardModel, tuple[EncoderPins, EncoderPins]] = {
    BoardModel.TREX: (EncoderPins(port="D", a_bit=5, b_bit=6), EncoderPins(port="B", a_bit=4, b_bit=5)),
    BoardModel.NANO: (EncoderPins(port="D", a_bit=5, b_bit=6), EncoderPins(port="B", a_bit=0, b_bit=1)),
}
"""Pins of the left and the right encoder."""
