"""Progress and result of a drive to a goal."""

from dataclasses import dataclass, replace
from typing import Self

from thumper.common.attribute_hints import HintedAttributes
from thumper.common.geometry import Pose2


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DriveResult(HintedAttributes):
    """How a drive to a goal ended."""

    reached: bool  # whether the robot arrived
    interrupted: bool  # by the user: Ctrl-C, or a request over the bus
    reason: str  # why the drive ended
    time_s: float  # duration of this drive
    path_length_m: float  # from the wheels
    pose: Pose2  # estimated, in the map, at the end
    navigation_failed: bool = False  # the navigator gave up the goal; no part of the robot failed

    def __repr__(self) -> str:
        end = "reached" if self.reached else "not reached"
        return f"<{end}: {self.reason}; path {self.path_length_m:.2f} m, {self.time_s:.1f} s>"

    def after(self, earlier: "Self | None") -> "Self":
        """Return this result with the time and path length of an earlier drive added."""
        if earlier is None:
            return self
        return replace(
            self,
            time_s=earlier.time_s + self.time_s,
            path_length_m=earlier.path_length_m + self.path_length_m,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveProgress:
    """What a progress display needs, once per cycle."""

    time_s: float
    distance_to_goal_m: float
    remark: str  # why the robot moves as it does, or stands; empty on a plain drive
