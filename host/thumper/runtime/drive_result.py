"""What a drive tells while it lasts, and how it ended."""

from dataclasses import dataclass, replace
from typing import Self

from thumper.common.geometry import Pose2


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveResult:
    """How a drive to a goal ended."""

    reached: bool
    interrupted: bool  # by the user, with Ctrl-C or over the bus
    reason: str
    time_s: float
    path_length_m: float  # driven, by the wheels
    map_from_base: Pose2  # where the robot believes it stopped

    def after(self, earlier: "Self | None") -> "Self":
        """This ending, with the time and the way of an earlier drive added."""
        if earlier is None:
            return self
        return replace(
            self,
            time_s=earlier.time_s + self.time_s,
            path_length_m=earlier.path_length_m + self.path_length_m,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveProgress:
    """What a display needs once a beat."""

    time_s: float
    distance_to_goal_m: float
    reason: str
