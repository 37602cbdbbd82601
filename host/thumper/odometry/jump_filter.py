"""Remove and count jumps in the odometry, as when the board or its program restarts."""

import math
from collections import deque

from thumper.common.geometry import Pose2

MAX_SPEED_M_S = 10.0  # faster than any robot of this kind
MIN_JUMP_M = 1.0  # stamps arrive in bursts and step back, so a short step is never a jump
JUMP_STEPS = 5.0  # nor is a step of up to this many times a recent one: a log may hold every twentieth scan
RECENT_STEPS = 11


class JumpFilter:
    """Passes odometry through. Across a jump it assumes that the robot was stationary."""

    def __init__(self) -> None:
        self._last: tuple[float, Pose2] | None = None  # time and pose of the input
        self._steps_m: deque[float] = deque(maxlen=RECENT_STEPS)
        self._filtered_from_odom = Pose2()
        self.jumps, self.largest_m = 0, 0.0

    def filter(self, time_s: float, odom_from_base: Pose2) -> Pose2:
        """Return the pose without the jumps so far."""
        last, self._last = self._last, (time_s, odom_from_base)
        if last is not None:
            distance_m = last[1].distance_m(odom_from_base)
            if self._is_jump(time_s - last[0], distance_m):
                self.jumps, self.largest_m = self.jumps + 1, max(self.largest_m, distance_m)
                self._filtered_from_odom = self._filtered_from_odom @ last[1] @ odom_from_base.inverse()
            else:
                self._steps_m.append(distance_m)
        return self._filtered_from_odom @ odom_from_base if self.jumps else odom_from_base

    def summary_lines(self) -> list[str]:
        """Return one line if there were jumps, else none."""
        if not self.jumps:
            return []
        times = "once" if self.jumps == 1 else f"{self.jumps} times"
        return [
            f"the odometry jumped {times}, by up to {self.largest_m:.1f} m: read as no motion; "
            "did the board or its program restart?"
        ]

    def _is_jump(self, step_s: float, distance_m: float) -> bool:
        if not self._steps_m or step_s == 0.0:  # a clock that has stopped says nothing about speed
            return False
        reachable_m = MAX_SPEED_M_S * step_s if math.isfinite(step_s) else 0.0
        return distance_m > max(MIN_JUMP_M, reachable_m, JUMP_STEPS * max(self._steps_m))
