"""Detect wheel slip by comparing the motion of the wheels with that of the scans."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt

from thumper.common.geometry import Pose2

GOOD_MATCH = 0.5  # smallest match score of a pose that can prove a slip


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipOptions:
    """Segment length, and the disagreement that counts as a slip."""

    way_m: Annotated[float, Gt(0)] = 0.3  # compare over this distance ...
    turn_rad: Annotated[float, Gt(0)] = 0.5  # ... or this rotation, by the wheels or by the scans
    share: Annotated[float, Ge(0)] = 0.3  # tolerated share of the distance or rotation ...
    least_m: Annotated[float, Ge(0)] = 0.1  # ... and at least this much
    least_rad: Annotated[float, Ge(0)] = 0.15


class _PosePair(NamedTuple):
    """The same pose by the wheels and by the scans."""

    odom_from_base: Pose2
    map_from_base: Pose2


class _Disagreement(NamedTuple):
    """Motion of wheels and scans over a segment, and the difference [m, rad]."""

    wheels: Pose2
    scans: Pose2
    error_m: float
    error_rad: float


class _Suspect(NamedTuple):
    """Start of a segment in which wheels and scans disagreed, and the tolerated difference."""

    start: _PosePair
    limit_m: float
    limit_rad: float

    def tolerates(self, difference: _Disagreement) -> bool:
        return difference.error_m <= self.limit_m and difference.error_rad <= self.limit_rad


class SlipDetector:
    """Counts segments of the drive in which wheels and scans disagree and the next segment confirms it.

    If the clocks of board and lidar differ, or a match was wrong, the next segment takes the error back.
    """

    def __init__(self, options: SlipOptions | None = None) -> None:
        self._options = options or SlipOptions()
        self._start: _PosePair | None = None
        self._suspect: _Suspect | None = None  # the previous segment, if wheels and scans disagreed in it
        self.slips = 0
        self.worst_m = self.worst_rad = 0.0

    def update(self, odom_from_base: Pose2, map_from_base: Pose2) -> bool:
        """Add both poses of a well-matched scan; return whether the previous segment was a slip."""
        options, now = self._options, _PosePair(odom_from_base, map_from_base)
        if self._start is None:
            self._start = now
            return False
        difference = _compare(self._start, now)
        wheels, scans = difference.wheels, difference.scans
        distance_m = max(math.hypot(wheels.x_m, wheels.y_m), math.hypot(scans.x_m, scans.y_m))
        turn_rad = max(abs(wheels.theta_rad), abs(scans.theta_rad))
        if distance_m < options.way_m and turn_rad < options.turn_rad:
            return False
        segment = _Suspect(
            start=self._start,
            limit_m=max(options.least_m, options.share * distance_m),
            limit_rad=max(options.least_rad, options.share * turn_rad),
        )
        self._start = now
        previous, self._suspect = self._suspect, None if segment.tolerates(difference) else segment
        if previous is None:
            return False
        total = _compare(previous.start, now)
        if previous.tolerates(total):
            self._suspect = None  # this segment took the error back
            return False
        self.slips += 1
        self.worst_m = max(self.worst_m, total.error_m)
        self.worst_rad = max(self.worst_rad, total.error_rad)
        return True

    def reset(self) -> None:
        """Start a new segment at the next pose: there is no match now, or the pose was set by the user."""
        self._start = self._suspect = None

    def summary_lines(self) -> list[str]:
        """Return one line if there were slips, else none."""
        if not self.slips:
            return []
        times = "once" if self.slips == 1 else f"{self.slips} times"
        return [
            f"wheels and scans disagreed {times}, by up to {self.worst_m:.2f} m and "
            f"{math.degrees(self.worst_rad):.0f} degrees: the wheels slip, or [drive] is not calibrated"
        ]


def _compare(start: _PosePair, end: _PosePair) -> _Disagreement:
    wheels, scans = (one.inverse() @ other for one, other in zip(start, end, strict=True))
    error = wheels.inverse() @ scans
    return _Disagreement(wheels, scans, math.hypot(error.x_m, error.y_m), abs(error.theta_rad))
