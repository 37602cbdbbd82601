"""Gains as the board gets them: in range, and rounded to its fixed point before anybody judges them."""

from dataclasses import dataclass, fields

from thumper.board.messages import PARAMETERS
from thumper.common.errors import ThumperError

NOMINAL_V = 7.4  # the board's feed-forward refers to this battery voltage

SPECS = {spec.name: spec for spec in PARAMETERS}


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardGains:
    """The board's control parameters in their own units (docs/protocol.md); each lies on the wire's grid."""

    kp: float
    ki: float
    ks: float
    kv: float
    ka: float
    acceleration: float

    def items(self) -> list[tuple[str, float]]:
        """Names and values, in the board's order."""
        return [(entry.name, getattr(self, entry.name)) for entry in fields(self)]

    def integers(self) -> dict[str, int]:
        """What goes over the wire."""
        return {name: round(value * SPECS[name].scale) for name, value in self.items()}


def on_the_wire(
    *, kp: float, ki: float, ks: float = 0.0, kv: float = 0.0, ka: float = 0.0, acceleration: float = 0.0
) -> BoardGains:
    """Round to the wire's grid.

    Raises
    ------
    ThumperError
        A value does not fit the parameter's range: refused, never wrapped or clipped.
    """
    values = {"kp": kp, "ki": ki, "ks": ks, "kv": kv, "ka": ka, "acceleration": acceleration}
    rounded = {}
    for name, value in values.items():
        spec = SPECS[name]
        if not spec.minimum <= value <= spec.maximum:
            raise ThumperError(
                f"{name} = {value:.4g} {spec.unit} does not fit the board "
                f"({spec.minimum:g}...{spec.maximum:g}); check the log's units, or choose a slower design"
            )
        rounded[name] = round(value * spec.scale) / spec.scale
    return BoardGains(**rounded)
