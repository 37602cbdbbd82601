"""How fast this computer is now, against its fastest: other programs must not make the robot slower.

A busy or virtual computer needs more CPU time for the same work. A short reference loop measures by how much.
"""

import time

LOOPS = 4000
"""Steps of the reference loop: about 0.2 ms on a desktop core."""

PERIOD_S = 0.25
MEMORY = 0.7
"""Weight of the earlier ratios in the smoothed one."""


class CpuSpeed:
    """Measures the ratio of the fastest reference loop to a present one, at most every `PERIOD_S`."""

    def __init__(self) -> None:
        self._fastest_s = min(_reference_s() for _ in range(20))
        self._ratio = 1.0
        self._next_s = 0.0

    def ratio(self, now_s: float) -> float:
        """Return the present speed, 0...1 of the fastest; `now_s` is any clock."""
        if now_s >= self._next_s:
            self._next_s = now_s + PERIOD_S
            loop_s = min(_reference_s() for _ in range(3))
            self._fastest_s = min(self._fastest_s, loop_s)
            self._ratio = MEMORY * self._ratio + (1.0 - MEMORY) * self._fastest_s / loop_s
        return self._ratio


def _reference_s() -> float:
    started_s, total = time.thread_time(), 0
    for number in range(LOOPS):
        total += number * number
    return time.thread_time() - started_s
