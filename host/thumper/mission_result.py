"""What a drive tells while it lasts, and how it ended."""

from dataclasses import dataclass

from thumper.geometry import Pose2


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionResult:
    """How a drive to a goal ended."""

    reached: bool
    interrupted: bool  # by the user, with Ctrl-C or over the bus
    reason: str
    time_s: float
    path_length_m: float
    map_from_base: Pose2  # where the robot believes it stopped


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """What a display needs once a beat."""

    time_s: float
    distance_to_goal_m: float
    reason: str
