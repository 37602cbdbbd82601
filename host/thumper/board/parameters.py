"""The board's parameters by name."""

from thumper.board.messages import PARAMETERS, ParameterSpec
from thumper.common.errors import ThumperError


def parameter_named(name: str) -> ParameterSpec:
    """Return a parameter's unit, range and scale; raises `ThumperError` when there is none of that name."""
    for spec in PARAMETERS:
        if spec.name == name:
            return spec
    names = ", ".join(spec.name for spec in PARAMETERS)
    raise ThumperError(f"the board has no parameter {name!r}; it has {names}")
