"""Notices that the robot gets nowhere: it stands still, or it moves without coming nearer."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt

from thumper.common.geometry import Pose2, wrap_angle


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgressOptions:
    """What counts as getting somewhere."""

    # The robot must move this far [m] ...
    moved_m: Annotated[float, Gt(0)] = 0.10
    # ... or turn this far [rad] ...
    turned_rad: Annotated[float, Gt(0)] = 0.5
    # ... within this time [s].
    still_s: Annotated[float, Gt(0)] = 6.0
    # The way left must shrink by this much [m] ...
    nearer_m: Annotated[float, Gt(0)] = 0.20
    # ... within this time [s]; catches a robot that dances or changes its mind for ever.
    idle_s: Annotated[float, Gt(0)] = 40.0
    # Time without coming nearer, recoveries included, after which the goal is given up [s] ...
    give_up_s: Annotated[float, Gt(0)] = 60.0
    # ... and on top of it the time that the longest way round found since then takes at this speed [m/s].
    pace_m_s: Annotated[float, Gt(0)] = 0.2
    # Time that the wheels are told to turn and the odometry says that they stand, before the drive ends [s].
    frozen_s: Annotated[float, Gt(0)] = 3.0
    # Time without a known position before the drive ends [s]; the robot stands meanwhile.
    lost_s: Annotated[float, Gt(0)] = 10.0


class ProgressChecker:
    """Watches pose and way left; `complaint` is what is wrong, or empty."""

    def __init__(self, options: ProgressOptions) -> None:
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Start afresh (a new goal)."""
        self._least_m = math.inf
        self._won_s = math.nan
        self._round_m = 0.0
        self.renew()

    def renew(self) -> None:
        """Grant the full times again (after a recovery); the least way left is remembered."""
        self._anchor: Pose2 | None = None
        self._anchor_s = math.nan
        self._nearer_s = math.nan

    def is_hopeless(self, time_s: float) -> bool:
        """Whether no new ground was won for so long that trying again makes no sense.

        A way round takes its time before it brings the robot nearer; but only a way longer than any before
        grants more, so that a way that comes and goes does not renew the time for ever.
        """
        return time_s - self._won_s > self._options.give_up_s + self._round_m / self._options.pace_m_s

    def idle_for_s(self, time_s: float) -> float:
        """Time since new ground was last won [s]."""
        return time_s - self._won_s

    def standing_s(self, time_s: float) -> float:
        """Time since it last got out of the place that it stands in [s]."""
        return 0.0 if self._anchor is None else time_s - self._anchor_s

    def update(self, time_s: float, map_from_base: Pose2, remaining_m: float) -> tuple[str, bool]:
        """Return (complaint, nearer): what is wrong or an empty string, and whether new ground was won."""
        options = self._options
        if self._anchor is None:
            self._anchor, self._anchor_s, self._nearer_s = map_from_base, time_s, time_s
        if math.isnan(self._won_s):
            self._won_s = time_s
        if math.isfinite(remaining_m):
            self._round_m = max(self._round_m, remaining_m)
        turned_rad = abs(wrap_angle(map_from_base.theta_rad - self._anchor.theta_rad))
        if self._anchor.distance_m(map_from_base) > options.moved_m or turned_rad > options.turned_rad:
            self._anchor, self._anchor_s = map_from_base, time_s
        nearer = remaining_m < self._least_m - options.nearer_m
        if nearer:
            self._least_m, self._nearer_s, self._won_s = remaining_m, time_s, time_s
            self._round_m = remaining_m
        if time_s - self._anchor_s > options.still_s:
            return f"no movement for {options.still_s:.0f} s", nearer
        if time_s - self._nearer_s > options.idle_s:
            return f"no nearer to the goal for {options.idle_s:.0f} s", nearer
        return "", nearer
