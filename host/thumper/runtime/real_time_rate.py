"""Slows a simulated robot down to a real-time factor, so that a person can watch and steer it."""

import time
from collections.abc import Callable

MAX_SLEEP_S = 0.25


class RealTimeRate:
    """Call `wait` once per cycle. It returns at once for a real robot, which is not `simulated`."""

    def __init__(self, now_s: Callable[[], float], *, simulated: bool) -> None:
        self._now_s = now_s
        self._simulated = simulated
        self.speed = 1.0
        self._wall_s, self._robot_s = time.monotonic(), now_s()

    def set_speed(self, speed: float) -> None:
        """Run at `speed` times real time from now on."""
        self.speed = speed
        self._wall_s, self._robot_s = time.monotonic(), self._now_s()

    def wait(self) -> None:
        """Sleep until real time has caught up with the robot's clock."""
        if not self._simulated:
            return
        due_s = self._wall_s + (self._now_s() - self._robot_s) / self.speed
        ahead_s = due_s - time.monotonic()
        if ahead_s < -MAX_SLEEP_S:  # the computer was slow or suspended: do not catch up
            self.set_speed(self.speed)
        elif ahead_s > 0.0:
            time.sleep(min(ahead_s, MAX_SLEEP_S))
