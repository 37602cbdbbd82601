"""The turn that a gyroscope measured between any two times."""

import math
from bisect import bisect_right
from collections import deque

from thumper.imu.sample import ImuSample

LARGEST_GAP_S = 0.1  # a gyroscope without samples for longer than this is not used
MAX_SAMPLES = 1000


class TurnBuffer:
    """Adds up the rates of the samples: the turns of successive intervals add up to the whole turn."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque(maxlen=MAX_SAMPLES)
        self._turns_rad: deque[float] = deque(maxlen=MAX_SAMPLES)  # since the first sample
        self._rate_rad_s = 0.0  # of the newest sample
        self._reported_rad: float | None = None  # the turn up to the end of the last interval

    def add(self, sample: ImuSample) -> None:
        """Add a sample. Drops one that is out of order or not finite; starts again after a gap."""
        if not math.isfinite(sample.yaw_rate_rad_s) or not math.isfinite(sample.time_s):
            return
        before_s = self._times_s[-1] if self._times_s else -math.inf
        if sample.time_s <= before_s and before_s - sample.time_s < 1.0:
            return
        if not 0.0 < sample.time_s - before_s <= LARGEST_GAP_S:  # the first, a gap, or a clock set back
            self._times_s.clear()
            self._turns_rad.clear()
            self._reported_rad = None
            before_s = sample.time_s
        turn_rad = self._turns_rad[-1] if self._turns_rad else 0.0
        self._times_s.append(sample.time_s)
        self._turns_rad.append(turn_rad + sample.yaw_rate_rad_s * (sample.time_s - before_s))
        self._rate_rad_s = sample.yaw_rate_rad_s

    def turn_until(self, time_s: float) -> float | None:
        """Return the turn [rad] since the last call; None without samples for that time.

        Past the newest sample its rate continues; the next call takes back what was wrong with that.
        """
        before_rad, self._reported_rad = self._reported_rad, self._turn_at(time_s)
        if before_rad is None or self._reported_rad is None:
            return None
        return self._reported_rad - before_rad

    def _turn_at(self, time_s: float) -> float | None:
        if not self._times_s or not self._times_s[0] <= time_s <= self._times_s[-1] + LARGEST_GAP_S:
            return None
        if time_s >= self._times_s[-1]:
            return self._turns_rad[-1] + self._rate_rad_s * (time_s - self._times_s[-1])
        after = bisect_right(self._times_s, time_s)
        start_s, end_s = self._times_s[after - 1], self._times_s[after]
        start_rad, end_rad = self._turns_rad[after - 1], self._turns_rad[after]
        return start_rad + (end_rad - start_rad) * (time_s - start_s) / (end_s - start_s)
