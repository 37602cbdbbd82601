"""Slip, told by comparing what the wheels say with what the scans say."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from thumper.geometry import Pose2

GOOD_MATCH = 0.5  # share of the beams explained: such a pose can convict the wheels


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipOptions:
    """When the two disagree enough to be told."""

    way_m: Annotated[float, Gt(0)] = 0.3  # they are compared over this much way ...
    turn_rad: Annotated[float, Gt(0)] = 0.5  # ... or this much turn, by the wheels or by the scans
    share: Annotated[float, Ge(0)] = 0.3  # of the way or turn that may be missing ...
    least_m: Annotated[float, Ge(0)] = 0.1  # ... and at least this much
    least_rad: Annotated[float, Ge(0)] = 0.15


class SlipWatch:
    """Counts stretches of the drive in which wheels and scans disagree."""

    def __init__(self, options: SlipOptions | None = None) -> None:
        self._options = options or SlipOptions()
        self._start: tuple[Pose2, Pose2] | None = None
        self.slips = 0
        self.worst_m = self.worst_rad = 0.0

    def look(self, odom_from_base: Pose2, map_from_base: Pose2) -> bool:
        """Take both poses of a scan that was matched well; whether a slip was just seen."""
        options = self._options
        if self._start is None:
            self._start = odom_from_base, map_from_base
            return False
        wheels = self._start[0].inverse() @ odom_from_base
        scans = self._start[1].inverse() @ map_from_base
        way_m = max(math.hypot(wheels.x_m, wheels.y_m), math.hypot(scans.x_m, scans.y_m))
        turn_rad = max(abs(wheels.theta_rad), abs(scans.theta_rad))
        if way_m < options.way_m and turn_rad < options.turn_rad:
            return False
        self._start = odom_from_base, map_from_base
        apart = wheels.inverse() @ scans
        off_m, off_rad = math.hypot(apart.x_m, apart.y_m), abs(apart.theta_rad)
        slipped = off_m > max(options.least_m, options.share * way_m)
        slipped = slipped or off_rad > max(options.least_rad, options.share * turn_rad)
        if slipped:
            self.slips += 1
            self.worst_m, self.worst_rad = max(self.worst_m, off_m), max(self.worst_rad, off_rad)
        return slipped

    def skip(self) -> None:
        """The scans say nothing just now, or the pose was changed by hand: begin anew at the next one."""
        self._start = None

    def lines(self) -> list[str]:
        """Nothing, or one line."""
        if not self.slips:
            return []
        return [
            f"{self.slips} times the wheels and the scans disagreed, by up to {self.worst_m:.2f} m and "
            f"{math.degrees(self.worst_rad):.0f} degrees: the wheels slip, or [drive] is not calibrated"
        ]
