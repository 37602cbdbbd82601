"""Slip, told by comparing what the wheels say with what the scans say."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from thumper.common.geometry import Pose2

GOOD_MATCH = 0.5  # share of the beams explained: such a pose can convict the wheels


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipOptions:
    """When the two disagree enough to be told."""

    way_m: Annotated[float, Gt(0)] = 0.3  # they are compared over this much way ...
    turn_rad: Annotated[float, Gt(0)] = 0.5  # ... or this much turn, by the wheels or by the scans
    share: Annotated[float, Ge(0)] = 0.3  # of the way or turn that may be missing ...
    least_m: Annotated[float, Ge(0)] = 0.1  # ... and at least this much
    least_rad: Annotated[float, Ge(0)] = 0.15


Stretch = tuple[Pose2, Pose2]  # where it began: odom_from_base, map_from_base


class SlipDetector:
    """Counts stretches of the drive in which wheels and scans disagree, and do not agree again in the next.

    Where the clocks of wheels and lidar differ, or a match was off, the next stretch takes it back.
    """

    def __init__(self, options: SlipOptions | None = None) -> None:
        self._options = options or SlipOptions()
        self._start: Stretch | None = None
        # The stretch before this one, if they disagreed in it, and by how much they may at most [m, rad].
        self._suspect: tuple[Stretch, float, float] | None = None
        self.slips = 0
        self.worst_m = self.worst_rad = 0.0

    def update(self, odom_from_base: Pose2, map_from_base: Pose2) -> bool:
        """Take both poses of a scan that was matched well; whether the stretch before is now found a slip."""
        options, now = self._options, (odom_from_base, map_from_base)
        if self._start is None:
            self._start = now
            return False
        wheels, scans, off_m, off_rad = _compared(self._start, now)
        way_m = max(math.hypot(wheels.x_m, wheels.y_m), math.hypot(scans.x_m, scans.y_m))
        turn_rad = max(abs(wheels.theta_rad), abs(scans.theta_rad))
        if way_m < options.way_m and turn_rad < options.turn_rad:
            return False
        may_m = max(options.least_m, options.share * way_m)
        may_rad = max(options.least_rad, options.share * turn_rad)
        disagree = off_m > may_m or off_rad > may_rad
        start, self._start = self._start, now
        suspect, self._suspect = self._suspect, (start, may_m, may_rad) if disagree else None
        if suspect is None:
            return False
        began, may_m, may_rad = suspect
        _, _, off_m, off_rad = _compared(began, now)
        if off_m <= may_m and off_rad <= may_rad:
            self._suspect = None  # this stretch took it back
            return False
        self.slips += 1
        self.worst_m, self.worst_rad = max(self.worst_m, off_m), max(self.worst_rad, off_rad)
        return True

    def reset(self) -> None:
        """The scans say nothing just now, or the pose was changed by hand: begin anew at the next one."""
        self._start = self._suspect = None

    def summary_lines(self) -> list[str]:
        """Nothing, or one line."""
        if not self.slips:
            return []
        often = "once" if self.slips == 1 else f"{self.slips} times"
        return [
            f"{often} the wheels and the scans disagreed, by up to {self.worst_m:.2f} m and "
            f"{math.degrees(self.worst_rad):.0f} degrees: the wheels slip, or [drive] is not calibrated"
        ]


def _compared(start: Stretch, end: Stretch) -> tuple[Pose2, Pose2, float, float]:
    """How far wheels and scans went, and how far apart they are [m, rad]."""
    wheels, scans = (one.inverse() @ other for one, other in zip(start, end, strict=True))
    apart = wheels.inverse() @ scans
    return wheels, scans, math.hypot(apart.x_m, apart.y_m), abs(apart.theta_rad)
