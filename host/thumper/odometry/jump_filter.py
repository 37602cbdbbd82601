"""Odometry that leaps, as when its board or program begins anew: the leap is taken out and counted."""

import math
from collections import deque

from thumper.common.geometry import Pose2

FASTEST_M_S = 10.0  # no robot of this kind drives so fast ...
LEAST_M = 1.0  # ... but stamps come in bursts, and step back: a short way is no leap
FAR_STEPS = 5.0  # nor is this many times a way that was usual: a log may hold every twentieth scan
STEPS = 11


class JumpFilter:
    """Passes odometry on; across a leap the robot is taken to have stood, and goes on from there."""

    def __init__(self) -> None:
        self._last: tuple[float, Pose2] | None = None  # time and pose as they came
        self._steps_m: deque[float] = deque(maxlen=STEPS)
        self._bridged_from_odom = Pose2()
        self.jumps, self.largest_m = 0, 0.0

    def filter(self, time_s: float, odom_from_base: Pose2) -> Pose2:
        """The pose without the leaps so far."""
        last, self._last = self._last, (time_s, odom_from_base)
        if last is not None:
            way_m = last[1].distance_m(odom_from_base)
            if self._is_leap(time_s - last[0], way_m):
                self.jumps, self.largest_m = self.jumps + 1, max(self.largest_m, way_m)
                self._bridged_from_odom = self._bridged_from_odom @ last[1] @ odom_from_base.inverse()
            else:
                self._steps_m.append(way_m)
        return self._bridged_from_odom @ odom_from_base if self.jumps else odom_from_base

    def summary_lines(self) -> list[str]:
        """Nothing, or one line."""
        if not self.jumps:
            return []
        often = "once" if self.jumps == 1 else f"{self.jumps} times"
        return [
            f"{often} the odometry leapt, by up to {self.largest_m:.1f} m: taken as no motion; "
            "did its board or program begin anew?"
        ]

    def _is_leap(self, step_s: float, way_m: float) -> bool:
        if not self._steps_m:
            return False
        fastest_m = FASTEST_M_S * step_s if math.isfinite(step_s) else 0.0
        return way_m > max(LEAST_M, fastest_m, FAR_STEPS * max(self._steps_m))
