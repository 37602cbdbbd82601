"""The board's parameters over the bus: their ranges, their values, and how to change them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from thumper.board.messages import PARAMETERS
from thumper.common.errors import ThumperError

DOCS = {spec.name: spec.doc for spec in PARAMETERS}


class Asker(Protocol):
    """The part of the bus that parameters need."""

    def query(self, name: str, content: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Ask the robot and return its answer; raises ThumperError when it refuses or gives none."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter as the robot describes it."""

    name: str
    unit: str
    minimum: float
    maximum: float
    default: float
    step: float  # the finest that the wire carries

    def objection(self, value: Any) -> str:
        """Why this value cannot be set; empty when it can."""
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if number and self.minimum <= value <= self.maximum:
            return ""
        return f"give {self.minimum:g} … {self.maximum:g}"


class Parameters:
    """What the page asks of the robot about its board; each call waits for the answer."""

    def __init__(self, bus: Asker) -> None:
        self._bus = bus

    def schema(self) -> list[Parameter]:
        """Every parameter of the board."""
        return [Parameter(**entry) for entry in self._bus.query("parameters/schema", {})["parameters"]]

    def values(self) -> dict[str, float]:
        """What the board works with now."""
        return _numbers(self._bus.query("parameters/get", {}))

    def change(self, known: Mapping[str, Parameter], wanted: Mapping[str, Any]) -> dict[str, float]:
        """Set some of them; returns what the board made of them.

        Raises
        ------
        ThumperError
            A value is out of its range (nothing is sent then), or the robot or its board refuses.
        """
        for name, value in wanted.items():
            if objection := known[name].objection(value):
                raise ThumperError(f"{name} = {value!r} is refused: {objection} {known[name].unit}")
        return _numbers(self._bus.query("parameters/set", dict(wanted)))

    def save(self) -> None:
        """Have the board keep them across resets."""
        self._bus.query("parameters/save", {})

    def revert(self) -> dict[str, float]:
        """Go back to what the board has saved."""
        return _numbers(self._bus.query("parameters/revert", {}))


def _numbers(answer: Mapping[str, Any]) -> dict[str, float]:
    return {str(name): float(value) for name, value in answer["values"].items()}
