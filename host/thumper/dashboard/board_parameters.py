"""Read and change the board's parameters over the bus."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from thumper.board.messages import PARAMETERS
from thumper.common.errors import ThumperError
from thumper.ros import services
from thumper.ros.service import QueryClient

DOCS = {spec.name: spec.doc for spec in PARAMETERS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """Range and default of one parameter."""

    name: str
    unit: str
    minimum: float
    maximum: float
    default: float
    step: float  # resolution on the wire

    def range_error(self, value: Any) -> str:
        """Return why the value cannot be set; empty if it can."""
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if number and self.minimum <= value <= self.maximum:
            return ""
        return f"must be {self.minimum:g} … {self.maximum:g}"


class Parameters:
    """The robot's parameter services; each call waits for the answer."""

    def __init__(self, bus: QueryClient) -> None:
        self._bus = bus

    def schema(self) -> list[Parameter]:
        """Return the range of every parameter."""
        return [Parameter(**entry) for entry in services.PARAMETERS_SCHEMA.call(self._bus).parameters]

    def values(self) -> dict[str, float]:
        """Return the values in use."""
        return _numbers(services.PARAMETERS_GET.call(self._bus))

    def set(self, schema: Mapping[str, Parameter], values: Mapping[str, Any]) -> dict[str, float]:
        """Set parameters; return the values as the board rounded them.

        Raises
        ------
        ThumperError
            A value is out of range (then none is sent), or the robot or its board refuses.
        """
        for name, value in values.items():
            if error := schema[name].range_error(value):
                raise ThumperError(f"{name} = {value!r}: {error} {schema[name].unit}")
        return _numbers(services.PARAMETERS_SET.call(self._bus, values))

    def save(self) -> None:
        """Save the values in use on the board, so that a reset keeps them."""
        services.PARAMETERS_SAVE.call(self._bus)

    def revert(self) -> dict[str, float]:
        """Return to the values saved on the board."""
        return _numbers(services.PARAMETERS_REVERT.call(self._bus))


def _numbers(reply: services.ParameterValues) -> dict[str, float]:
    return {str(name): float(value) for name, value in reply.values.items()}
