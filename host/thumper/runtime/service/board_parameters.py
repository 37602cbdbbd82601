"""The board's parameters for those who ask over the bus: names, ranges, values, and keeping them."""

from collections.abc import Iterable, Mapping
from typing import Any

from thumper.board.board import Board
from thumper.board.messages import PARAMETERS, Command
from thumper.common.errors import ThumperError
from thumper.runtime.service.board_jobs import BoardJob

PARAMETER_NAMES = tuple(spec.name for spec in PARAMETERS)


def schema() -> dict[str, Any]:
    """Every parameter: unit, range, default and the finest step the wire carries."""
    return {
        "parameters": [
            {
                "name": spec.name,
                "unit": spec.unit,
                "minimum": spec.minimum,
                "maximum": spec.maximum,
                "default": spec.default,
                "step": 1.0 / spec.scale,
            }
            for spec in PARAMETERS
        ]
    }


def values(board: Board, names: Iterable[str] = PARAMETER_NAMES) -> BoardJob:
    """What the board uses now."""
    known = {}
    for name in names:
        known[name] = board.get_parameter(name)
        yield
    return {"values": known}


def change(board: Board, content: Mapping[str, Any]) -> BoardJob:
    """Set parameters by name; nothing is set unless every name and value is right.

    Raises
    ------
    ThumperError
        No such parameter, a value that is no number or out of its range, or the board refuses.
    """
    specs = {spec.name: spec for spec in PARAMETERS}
    if not content:
        raise ThumperError("nothing to set: give names and values")
    for name, value in content.items():
        spec = specs.get(name)
        if spec is None:
            raise ThumperError(f"the board has no parameter {name!r}; it has {', '.join(specs)}")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not spec.minimum <= value <= spec.maximum:
            raise ThumperError(
                f"{name} = {value!r} is refused: give {spec.minimum:g}...{spec.maximum:g} {spec.unit}"
            )
    for name, value in content.items():
        board.set_parameter(name, float(value))
        yield
    return (yield from values(board, content))


def revert(board: Board) -> BoardJob:
    """Go back to what was saved."""
    board.command(Command.LOAD)
    yield
    return (yield from values(board))


def save(board: Board) -> dict[str, Any]:
    """Keep what is set across resets."""
    board.command(Command.SAVE)
    return {}
