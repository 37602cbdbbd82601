"""Detect that the robot makes no progress: it is stationary, or comes no nearer to the goal."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Gt

from thumper.common.geometry import Pose2, wrap_angle

TURNED_RAD = 0.5  # a rotation by this much is movement, too
NEARER_M = 0.20  # the remaining distance must shrink by this much to count as progress


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgressOptions:
    """What counts as progress, and how long the robot may go without it."""

    # The robot must move this far, or turn by 0.5 rad ... [m]
    moved_m: Annotated[float, Gt(0)] = 0.10
    # ... within this time, else a recovery begins [s].
    still_s: Annotated[float, Gt(0)] = 6.0
    # Time without coming 0.2 m nearer to the goal after which a recovery begins [s]; catches oscillation.
    idle_s: Annotated[float, Gt(0)] = 40.0
    # Time without coming nearer, recoveries included, after which the goal is aborted [s] ...
    give_up_s: Annotated[float, Gt(0)] = 60.0
    # ... plus the time that the longest detour found since then takes at this speed [m/s].
    pace_m_s: Annotated[float, Gt(0)] = 0.2
    # Time with commanded but without measured movement after which the drive ends [s].
    frozen_s: Annotated[float, Gt(0)] = 3.0
    # Time without a known pose after which the drive ends [s]; until then the robot is stopped.
    lost_s: Annotated[float, Gt(0)] = 10.0


class ProgressCheck(NamedTuple):
    """The result of one check."""

    nearer: bool  # the robot has come nearer to the goal than ever before
    problem: str | None


class ProgressChecker:
    """Watches pose and remaining distance of the drive to one goal."""

    def __init__(self, options: ProgressOptions) -> None:
        self._options = options
        self._least_m = math.inf  # remaining distance
        self._nearer_s = math.nan  # when it last shrank
        self._detour_m = 0.0  # longest remaining distance since then
        self._anchor: Pose2 | None = None
        self._anchor_s = math.nan
        self._idle_since_s = math.nan

    def restart_timers(self) -> None:
        """Allow the full times again (after a recovery); the least remaining distance is kept."""
        self._anchor = None
        self._anchor_s = self._idle_since_s = math.nan

    def is_hopeless(self, time_s: float) -> bool:
        """Return whether the robot has not come nearer for so long that trying again makes no sense.

        A detour takes time before it brings the robot nearer. Only a detour longer than any before grants
        more time, so that a path that comes and goes does not extend it for ever.
        """
        return time_s - self._nearer_s > self._options.give_up_s + self._detour_m / self._options.pace_m_s

    def idle_time_s(self, time_s: float) -> float:
        """Return the time since the robot last came nearer [s]."""
        return time_s - self._nearer_s

    def stationary_s(self, time_s: float) -> float:
        """Return the time since the robot last moved or turned away from where it is [s]."""
        return 0.0 if self._anchor is None else time_s - self._anchor_s

    def update(self, time_s: float, map_from_base: Pose2, remaining_m: float) -> ProgressCheck:
        """Return whether the robot has come nearer, and what is wrong, if anything."""
        options = self._options
        if self._anchor is None:
            self._anchor, self._anchor_s, self._idle_since_s = map_from_base, time_s, time_s
        if math.isnan(self._nearer_s):
            self._nearer_s = time_s
        if math.isfinite(remaining_m):
            self._detour_m = max(self._detour_m, remaining_m)
        turned_rad = abs(wrap_angle(map_from_base.theta_rad - self._anchor.theta_rad))
        if self._anchor.distance_m(map_from_base) > options.moved_m or turned_rad > TURNED_RAD:
            self._anchor, self._anchor_s = map_from_base, time_s
        nearer = remaining_m < self._least_m - NEARER_M
        if nearer:
            self._least_m, self._idle_since_s, self._nearer_s = remaining_m, time_s, time_s
            self._detour_m = remaining_m
        problem = None
        if time_s - self._anchor_s > options.still_s:
            problem = f"no movement for {options.still_s:.0f} s"
        elif time_s - self._idle_since_s > options.idle_s:
            problem = f"no nearer to the goal for {options.idle_s:.0f} s"
        return ProgressCheck(nearer=nearer, problem=problem)
