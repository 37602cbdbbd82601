"""The goals that were asked for, what has become of each, and which comes next. Pure."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

from thumper.common.errors import ThumperError
from thumper.navigation.goal import Goal
from thumper.runtime.drive_result import DriveResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Itinerary:
    """Goals in their order, driven `rounds` times."""

    goals: tuple[Goal, ...]
    rounds: int = 1

    def __post_init__(self) -> None:
        if not self.goals or self.rounds < 1:
            raise ValueError(f"an itinerary needs a goal and a round, got {self}")

    def legs(self) -> list[tuple[str, Goal]]:
        """What each drive is called, and its goal."""
        several = len(self.goals) > 1
        return [
            (
                (f"waypoint {n} of {len(self.goals)}" if several else "driving")
                + (f", round {lap} of {self.rounds}" if self.rounds > 1 else ""),
                goal,
            )
            for lap in range(1, self.rounds + 1)
            for n, goal in enumerate(self.goals, start=1)
        ]


def follow(itinerary: Itinerary, drive: Callable[[str, Goal], DriveResult]) -> DriveResult:
    """Drive the legs by `drive(name, goal)` until one is not reached; add up their times and ways.

    The reason says which leg failed. A leg that is refused before anything moves ends the drive like one
    that fails, but for the first: its ThumperError is the caller's.
    """
    result: DriveResult | None = None
    for name, goal in itinerary.legs():
        try:
            result = drive(name, goal).after(result)
        except ThumperError as error:
            if result is None:
                raise
            return replace(result, reached=False, reason=f"{name} {goal}: {error}")
        if not result.reached:
            several = len(itinerary.legs()) > 1
            return replace(result, reason=f"{name} {goal}: {result.reason}") if several else result
    assert result is not None  # an itinerary holds at least one leg
    return result


MAX_MISSIONS = 32


class MissionState(Enum):
    """How far a mission is."""

    DRIVING = "driving"
    REACHED = "reached"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class WaypointMission:
    """One request to drive somewhere, or round several places."""

    number: int
    goals: tuple[Goal, ...]
    source: str
    leg: int = 0
    state: MissionState = MissionState.DRIVING
    reason: str = ""


class Missions:
    """One at a time; a new one takes the place of the one under way."""

    def __init__(self) -> None:
        self._known: OrderedDict[int, WaypointMission] = OrderedDict()
        self._last = 0

    @property
    def newest(self) -> WaypointMission | None:
        """The mission that was begun last."""
        return self._known.get(self._last)

    def find(self, number: int) -> WaypointMission | None:
        """A mission by its number; old ones are forgotten."""
        return self._known.get(number)

    def begin(self, goals: tuple[Goal, ...], source: str) -> WaypointMission:
        """Set out on a new one."""
        self.end("another goal took its place")
        self._last += 1
        return self._keep(WaypointMission(number=self._last, goals=goals, source=source))

    def next_goal(self) -> Goal | None:
        """A leg was reached: return the goal of the next one, or None when that was the last."""
        mission = self.newest
        if mission is None or mission.leg + 1 >= len(mission.goals):
            return None
        return self._keep(replace(mission, leg=mission.leg + 1)).goals[mission.leg + 1]

    def end(self, reason: str, *, reached: bool = False) -> WaypointMission | None:
        """The mission under way is over; returns it, or None when there was none."""
        mission = self.newest
        if mission is None or mission.state is not MissionState.DRIVING:
            return None
        if len(mission.goals) > 1 and not reached:
            reason = f"waypoint {mission.leg + 1} of {len(mission.goals)}: {reason}"
        state = MissionState.REACHED if reached else MissionState.FAILED
        return self._keep(replace(mission, state=state, reason=reason))

    def _keep(self, mission: WaypointMission) -> WaypointMission:
        self._known[mission.number] = mission
        while len(self._known) > MAX_MISSIONS:
            self._known.popitem(last=False)
        return mission
