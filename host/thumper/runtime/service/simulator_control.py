"""What can be done to a simulated robot alone: its world, its faults, the speed of its clock."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from thumper.common.errors import ThumperError

MIN_SPEED, MAX_SPEED = 0.1, 20.0  # times real time


class Simulator(Protocol):
    """What a simulated robot's port offers beside its bytes."""

    def describe(self) -> dict[str, Any]:
        """The world and what can be done to it, as JSON takes it."""
        ...

    def apply(self, content: Mapping[str, Any]) -> str:
        """Do it; returns what was done, in words. Raises ThumperError."""
        ...


class SimulatorControl:
    """The simulator of this robot, if it has one here. Every method raises ThumperError with why not."""

    def __init__(self, simulator: Simulator | None) -> None:
        self.set_speed: Callable[[float], None] | None = None  # of its clock
        self._simulator = simulator

    def describe(self) -> dict[str, Any]:
        """The world and what can be done to it, as JSON takes it."""
        if self._simulator is None:
            raise ThumperError("this robot is real, or its simulator is elsewhere: its world cannot be told")
        return self._simulator.describe()

    def apply(self, content: Mapping[str, Any]) -> str:
        """Do what `content` says; returns what was done, in words."""
        if self._simulator is None:
            raise ThumperError("this robot is real, or its simulator runs elsewhere: nothing to simulate")
        if set(content) == {"speed"}:
            return self._change_speed(content["speed"])
        return self._simulator.apply(content)

    def _change_speed(self, speed: object) -> str:
        if (
            not isinstance(speed, int | float)
            or isinstance(speed, bool)
            or not MIN_SPEED <= speed <= MAX_SPEED
        ):
            raise ThumperError(f"the speed is {MIN_SPEED:g}...{MAX_SPEED:g} times real time")
        if self.set_speed is None:
            raise ThumperError("this run is not kept at any speed; `thumper run` without a goal is")
        self.set_speed(float(speed))
        return f"{speed:g} times real time"
