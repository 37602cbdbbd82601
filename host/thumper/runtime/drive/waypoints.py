"""Waypoints, and the missions that clients send: goals, their state, and which comes next. Pure."""

from collections import OrderedDict
from dataclasses import dataclass, replace
from enum import Enum
from typing import Self

from thumper.navigation.goal import Goal

MAX_MISSIONS = 32  # remembered, for clients that ask for the state of an old one


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """One goal of several, its name for people, and what the robot does there."""

    goal: Goal
    name: str = ""
    place: str = ""  # the name of the goal, if it has one
    wait_s: float = 0.0
    record: bool = False  # while it waits
    beep: bool = False  # on arrival, the pages and terminals that watch


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoints:
    """Waypoints in the order of driving, `rounds` times."""

    points: tuple[Waypoint, ...]
    rounds: int = 1

    def __post_init__(self) -> None:
        if not self.points or self.rounds < 1:
            raise ValueError(f"waypoints need at least one goal and one round, got {self}")

    @classmethod
    def at(cls, *goals: Goal, rounds: int = 1, wait_s: float = 0.0, place: str = "") -> Self:
        """Return these goals as waypoints; the robot waits as long at each. `place` names a single one."""
        points = tuple(Waypoint(goal=goal, wait_s=wait_s, place=place) for goal in goals)
        return cls(points=points, rounds=rounds)

    @property
    def has_one_leg(self) -> bool:
        """Whether there is a single goal and a single round."""
        return len(self.points) * self.rounds == 1

    def legs(self) -> list[Waypoint]:
        """Return all waypoints in the order of driving."""
        return [
            replace(point, name=self._name(number, lap, point.place))
            for lap in range(1, self.rounds + 1)
            for number, point in enumerate(self.points, start=1)
        ]

    def _name(self, number: int, lap: int, place: str) -> str:
        name = f"to {place}" if place else "driving"
        if len(self.points) > 1:
            name = f"waypoint {number} of {len(self.points)}" + (f", {place}" if place else "")
        return f"{name}, round {lap} of {self.rounds}" if self.rounds > 1 else name


class MissionState(Enum):
    """Progress of a mission."""

    DRIVING = "driving"
    REACHED = "reached"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class WaypointMission:
    """One request of a client to drive to a goal, or to several in turn."""

    number: int
    waypoints: Waypoints
    leg: int = 0
    state: MissionState = MissionState.DRIVING
    reason: str = ""

    @property
    def title(self) -> str:
        """What the mission is, for people."""
        points = self.waypoints.points
        return f"route of {len(points)} goals" if len(points) > 1 else f"goal {points[0].goal} m"

    @property
    def legs(self) -> list[Waypoint]:
        """The waypoints in the order of driving."""
        return self.waypoints.legs()


class Missions:
    """At most one is active; a new one replaces it."""

    def __init__(self) -> None:
        self._missions: OrderedDict[int, WaypointMission] = OrderedDict()
        self._last = 0

    @property
    def next_number(self) -> int:
        """The number that the next mission will get."""
        return self._last + 1

    @property
    def newest(self) -> WaypointMission | None:
        """The mission that was started last."""
        return self._missions.get(self._last)

    def find(self, number: int) -> WaypointMission | None:
        """Return a mission by its number; None if it is unknown or forgotten."""
        return self._missions.get(number)

    def start(self, waypoints: Waypoints) -> WaypointMission:
        """Start a new mission; it ends the active one."""
        self.end(self._last, "replaced by another goal")
        self._last += 1
        return self._store(WaypointMission(number=self._last, waypoints=waypoints))

    def set_leg(self, number: int, leg: int) -> None:
        """Note which leg of a mission is driven; ignore an unknown mission."""
        mission = self.find(number)
        if mission is not None:
            self._store(replace(mission, leg=leg))

    def end(self, number: int, reason: str, *, reached: bool = False) -> WaypointMission | None:
        """End a mission and return it; None if it is not active."""
        mission = self.find(number)
        if mission is None or mission.state is not MissionState.DRIVING:
            return None
        state = MissionState.REACHED if reached else MissionState.FAILED
        return self._store(replace(mission, state=state, reason=reason))

    def _store(self, mission: WaypointMission) -> WaypointMission:
        self._missions[mission.number] = mission
        while len(self._missions) > MAX_MISSIONS:
            self._missions.popitem(last=False)
        return mission
