"""Several goals one after another: the drive ends with the last, or where one is not reached."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from thumper.errors import ThumperError
from thumper.navigation.goal import Goal
from thumper.runtime import MissionResult


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


def follow(itinerary: Itinerary, drive: Callable[[str, Goal], MissionResult]) -> MissionResult:
    """Drive the legs by `drive(name, goal)` until one is not reached; add up their times and ways.

    The reason says which leg failed. A leg that is refused before anything moves ends the drive like one
    that fails, but for the first: its ThumperError is the caller's.
    """
    result: MissionResult | None = None
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
