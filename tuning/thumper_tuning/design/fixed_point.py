"""Gains in the board's fixed-point format: in range, and rounded before the loop is analyzed."""

from dataclasses import dataclass, fields

from thumper.board.messages import PARAMETERS
from thumper.common.errors import ThumperError

PARAMETER_SPECS = {spec.name: spec for spec in PARAMETERS}


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardGains:
    """The board's control parameters in their own units (docs/reference/protocol.md), in its fixed point."""

    kp: float
    ki: float
    ks: float
    kv: float
    ka: float
    acceleration: float

    def items(self) -> list[tuple[str, float]]:
        """Return names and values, in the board's order."""
        return [(entry.name, getattr(self, entry.name)) for entry in fields(self)]

    def wire_values(self) -> dict[str, int]:
        """Return the integers that go over the wire."""
        return {name: round(value * PARAMETER_SPECS[name].scale) for name, value in self.items()}


def to_fixed_point(
    *, kp: float, ki: float, ks: float = 0.0, kv: float = 0.0, ka: float = 0.0, acceleration: float = 0.0
) -> BoardGains:
    """Round gains to the board's fixed point.

    Raises
    ------
    ThumperError
        A value is out of the parameter's range. It is never clipped.
    """
    values = {"kp": kp, "ki": ki, "ks": ks, "kv": kv, "ka": ka, "acceleration": acceleration}
    rounded = {}
    for name, value in values.items():
        spec = PARAMETER_SPECS[name]
        if not spec.minimum <= value <= spec.maximum:
            raise ThumperError(
                f"{name} = {value:.4g} {spec.unit} is out of the board's range "
                f"({spec.minimum:g}...{spec.maximum:g}); check the log's units, or choose a slower design"
            )
        rounded[name] = round(value * spec.scale) / spec.scale
    return BoardGains(**rounded)
