"""Controls a simulated robot: its world, its faults, its real-time factor."""

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from thumper.common.errors import ThumperError
from thumper.ros.services import SimulatorWorld
from thumper.runtime.real_time_rate import RealTimeRate

MIN_SPEED, MAX_SPEED = 0.1, 20.0  # real-time factor
NO_SIMULATOR = "this robot is real, or its simulator runs in another process: nothing to simulate"


class Simulator(Protocol):
    """What the port of a simulated robot offers besides its bytes."""

    def describe(self) -> dict[str, Any]:
        """Return the world and the possible changes to it, ready for JSON."""
        ...

    def apply(self, content: Mapping[str, Any]) -> str:
        """Apply a change and return a description of it. Raises ThumperError."""
        ...


@runtime_checkable
class HasSimulator(Protocol):
    """A port whose other end is a simulator in this process."""

    @property
    def simulator(self) -> Simulator:
        """The simulator behind the port."""
        ...


class SimulatorControl:
    """The simulator of this robot, if it runs in this process; else every method raises ThumperError."""

    def __init__(self, simulator: Simulator | None) -> None:
        self.rate: RealTimeRate | None = None  # of a robot that serves
        self.can_restart = False  # whether the program starts the robot again in `next_world`
        self.next_world = ""
        self._simulator = simulator

    def describe(self) -> SimulatorWorld:
        """Return the world and the possible changes to it."""
        if self._simulator is None:
            raise ThumperError(NO_SIMULATOR)
        description = self._simulator.describe()
        if not self.can_restart:
            description["worlds"] = []
        return SimulatorWorld(**description, speed=self.rate.speed if self.rate else 1.0)

    def apply(self, content: Mapping[str, Any]) -> str:
        """Apply the change in `content` and return a description of it."""
        if self._simulator is None:
            raise ThumperError(NO_SIMULATOR)
        if set(content) == {"speed"}:
            return self._change_speed(content["speed"])
        if set(content) == {"world"}:
            return self._change_world(content["world"])
        return self._simulator.apply(content)

    def _change_world(self, world: object) -> str:
        description = self.describe()
        worlds = description.worlds
        if not worlds:
            raise ThumperError("only `thumper run` without a goal has a world to choose")
        if world not in worlds:
            raise ThumperError(f"unknown world {world!r}; choose from: {', '.join(worlds)}")
        self.next_world = str(world)
        title = description.titles.get(self.next_world, self.next_world).partition(":")[0]
        return f"the robot starts again in the world {title}, with a new map"

    def _change_speed(self, speed: object) -> str:
        if (
            not isinstance(speed, int | float)
            or isinstance(speed, bool)
            or not MIN_SPEED <= speed <= MAX_SPEED
        ):
            raise ThumperError(f"choose a speed of {MIN_SPEED:g}...{MAX_SPEED:g} times real time")
        if self.rate is None:
            raise ThumperError("only `thumper run` without a goal has a speed to set")
        self.rate.set_speed(float(speed))
        return f"{speed:g} times real time"
