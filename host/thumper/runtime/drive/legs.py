"""The legs of a task: what the robot does until its task decides again. Plain data."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.navigation.goal import Goal
from thumper.runtime.drive.motions import Motion

DRIVING = "driving"


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """One drive to a goal."""

    goal: Goal
    name: str = DRIVING
    purpose: str = ""  # of the task that the leg belongs to
    clear_fault: bool = False  # clear a fault that the board has latched
    until: Callable[[], bool] = lambda: False  # ends the leg early; the robot drives on to the next goal
    patience_s: float = math.inf  # give up if the robot has stayed in one place for this long

    @property
    def task(self) -> str:
        """What the robot drives for, as its status says."""
        name = f"to {self.goal} m" if self.name == DRIVING else self.name
        return f"{self.purpose}: {name}" if self.purpose else name


@dataclass(frozen=True, slots=True, kw_only=True)
class Cruise:
    """Drive at a constant speed for a while. Does not avoid obstacles."""

    twist: Twist2
    duration_s: float
    name: str = DRIVING


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """One simple motion."""

    motion: Motion
    name: str = DRIVING


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """Move nothing and map: for `duration_s`, or until `until` returns True."""

    duration_s: float = 0.0
    until: Callable[[], bool] = lambda: False
    max_cycles: float = math.inf
    name: str = "waiting"


AnyLeg = Leg | Cruise | Move | Wait
