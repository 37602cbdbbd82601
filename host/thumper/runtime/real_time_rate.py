"""Keeps a simulated robot at the speed of the clock on the wall, so that a person can watch and steer it."""

import time
from collections.abc import Callable

MAX_SLEEP_S = 0.25


class RealTimeRate:
    """Call `wait` once a beat; a robot that is not `paced`, being real, never waits."""

    def __init__(self, now_s: Callable[[], float], *, paced: bool) -> None:
        self._now_s = now_s
        self._paced = paced
        self.set_speed(1.0)

    def set_speed(self, speed: float) -> None:
        """Run `speed` times as fast as the clock on the wall from now on."""
        self.speed = speed
        self._wall_s, self._robot_s = time.monotonic(), self._now_s()

    def wait(self) -> None:
        """Sleep until the wall's clock is where the robot's is."""
        if not self._paced:
            return
        due_s = self._wall_s + (self._now_s() - self._robot_s) / self.speed
        ahead_s = due_s - time.monotonic()
        if ahead_s < -MAX_SLEEP_S:  # the machine was slow or slept: do not race after it
            self.set_speed(self.speed)
        elif ahead_s > 0.0:
            time.sleep(min(ahead_s, MAX_SLEEP_S))
