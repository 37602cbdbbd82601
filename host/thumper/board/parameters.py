"""Look up the board's parameters by name."""

from thumper.board.messages import PARAMETERS, ParameterSpec
from thumper.common.errors import ThumperError
from thumper.common.texts import choice_hint


def parameter_named(name: str) -> ParameterSpec:
    """Return a parameter's unit, range and scale; raise `ThumperError` for an unknown name."""
    for spec in PARAMETERS:
        if spec.name == name:
            return spec
    hint = choice_hint(name, [spec.name for spec in PARAMETERS])
    raise ThumperError(f"unknown board parameter {name!r}; {hint}")
