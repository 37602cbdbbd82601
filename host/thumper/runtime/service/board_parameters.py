"""Answers queries about the board's parameters: names, ranges, values; sets, saves and reverts them."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from thumper.board.board import Board
from thumper.board.messages import PARAMETERS, Command
from thumper.board.parameters import parameter_named
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.texts import choice_hint
from thumper.ros.services import Empty, ParameterSchema, ParameterValues
from thumper.runtime.service.board_jobs import BoardJob

ParameterJob = BoardJob[ParameterValues]
PARAMETER_NAMES = tuple(spec.name for spec in PARAMETERS)

FIRST_ROBOT_PARAMETER = parameter_named("counts_per_rev").index
"""From this one on they describe the robot, and the board refuses them while it is armed."""


def schema() -> ParameterSchema:
    """Return every parameter with unit, range, default and the resolution of the wire format."""
    return ParameterSchema(
        parameters=[
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
    )


def values(board: Board, names: Iterable[str] = PARAMETER_NAMES) -> ParameterJob:
    """Read the values that the board uses now."""
    known = {}
    for name in names:
        known[name] = board.get_parameter(name)
        yield
    return ParameterValues(values=known)


def described(values: Mapping[str, float]) -> str:
    """Return names and values as text, with the decimals that the wire format resolves."""
    decimals = {spec.name: math.floor(math.log10(spec.scale)) for spec in PARAMETERS}
    return ", ".join(f"{name} {round(value, decimals[name] or None)}" for name, value in values.items())


def change(board: Board, content: Mapping[str, Any]) -> ParameterJob:
    """Set parameters by name, all of them or none.

    The parameters that describe the robot come first and in one step: the board refuses the first of them
    while it is armed, and nothing can arm it in between. Nothing moves, so the step delays no motion.

    Raises
    ------
    ThumperError
        Unknown parameter, a value that is not a number or out of range, or the board refuses. If the board no
        longer answers, some may be set.
    """
    specs = {spec.name: spec for spec in PARAMETERS}
    if not content:
        raise ThumperError("no parameters given; pass names and values")
    for name, value in content.items():
        spec = specs.get(name)
        if spec is None:
            raise ThumperError(
                f"unknown parameter {name!r}; {choice_hint(name, specs)}", exit_code=EXIT_USAGE
            )
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not spec.minimum <= value <= spec.maximum:
            raise ThumperError(
                f"{name} = {value!r} is refused; choose {spec.minimum:g}...{spec.maximum:g} {spec.unit}",
                exit_code=EXIT_USAGE,
            )
    for name, value in sorted(content.items(), key=lambda item: specs[item[0]].index, reverse=True):
        board.set_parameter(name, float(value))
        if specs[name].index <= FIRST_ROBOT_PARAMETER:
            yield
    return (yield from values(board, content))


def revert(board: Board) -> ParameterJob:
    """Load the saved values."""
    board.command(Command.LOAD)
    yield
    return (yield from values(board))


def save(board: Board) -> BoardJob[Empty]:
    """Store the current values, so that they survive a reset."""
    yield from board.save()
    return Empty()
