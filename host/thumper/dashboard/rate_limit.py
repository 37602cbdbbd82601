"""Rate limit for the messages of a page: a token bucket."""

import time
from collections.abc import Callable


class RateLimit:
    """Allows `rate_Hz` on average and bursts of `burst`."""

    def __init__(self, rate_Hz: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate_Hz = rate_Hz
        self._burst = burst
        self._clock = clock
        self._tokens = float(burst)
        self._updated_s = clock()

    def allows(self) -> bool:
        """Take a token; return False if there is none."""
        now_s = self._clock()
        self._tokens = min(self._burst, self._tokens + self._rate_Hz * (now_s - self._updated_s))
        self._updated_s = now_s
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
