"""Notices that a device's clock has fallen behind the host's for good, not just one message. Pure.

A message that waits somewhere is late once. A clock that stopped for a while, or an offset that was measured
on a busy computer, makes every message late, however long one waits. Uncorrected, all data stays old.
"""

import math

WINDOW_S = 2.0


class ClockSlip:
    """Watches how late messages are, relative to what their delays explain."""

    def __init__(self, max_late_s: float) -> None:
        self._max_late_s = max_late_s
        self._since_s: float | None = None
        self._least_late_s = math.inf

    def update(self, received_s: float, late_s: float) -> float:
        """Add a message; return by how much the clock is behind, 0 if some message was in time lately.

        The clock is behind if all messages that arrived over `WINDOW_S` were late by more than the maximum.
        """
        if late_s <= self._max_late_s:
            self._since_s = None
            return 0.0
        if self._since_s is None:
            self._since_s, self._least_late_s = received_s, math.inf
        self._least_late_s = min(self._least_late_s, late_s)
        if received_s - self._since_s < WINDOW_S:
            return 0.0
        self._since_s = None
        return self._least_late_s
