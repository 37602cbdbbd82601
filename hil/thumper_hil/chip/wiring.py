"""Which pins the encoders of each board are on: chip/native/wiring.hpp, for those who drive them by hand."""

from dataclasses import dataclass

from thumper.board.messages import Board


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderPins:
    """A port's letter and the bits of channels A and B."""

    port: str
    a_bit: int
    b_bit: int


ENCODERS: dict[Board, tuple[EncoderPins, EncoderPins]] = {
    Board.TREX: (EncoderPins(port="D", a_bit=5, b_bit=6), EncoderPins(port="B", a_bit=4, b_bit=5)),
    Board.NANO: (EncoderPins(port="D", a_bit=5, b_bit=6), EncoderPins(port="B", a_bit=0, b_bit=1)),
}
"""Left, right."""
