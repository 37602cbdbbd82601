"""How often a page may ask: a bucket of tokens that fills with time."""

import time
from collections.abc import Callable


class RateLimit:
    """`rate_Hz` in the long run, `burst` at once."""

    def __init__(self, rate_Hz: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate_Hz = rate_Hz
        self._burst = burst
        self._clock = clock
        self._tokens = float(burst)
        self._then_s = clock()

    def allows(self) -> bool:
        """Take a token if there is one."""
        now_s = self._clock()
        self._tokens = min(self._burst, self._tokens + self._rate_Hz * (now_s - self._then_s))
        self._then_s = now_s
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
