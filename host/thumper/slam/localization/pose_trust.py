"""What the scans weighed at one place say for it: whether to believe it, drive by it, map from it."""

from collections import deque

WINDOW = 20  # weighed scans that count
CLEAR = 0.8  # support at a first look with which nobody needs to wait for a second ...
HOLDS, LOOKS, WAY_M = 0.6, 10, 1.0  # ... and after so many over so much way: the place is proven
REFUTED = 0.45  # mean fit at which the place is given up; of one that is not proven, support
LEAP_M = 0.5  # off where odometry leads: the looks before were at another place
LEAST_WAY_M = 0.1  # a look counts for so much way at least: each moves the pose by some centimetres
SURE_SHARE = 0.8  # of the weight, that one place must have


class PoseTrust:
    """Support is the mean fit of the scans, less the way that they push the pose off odometry, in m a metre.

    The fit of a scan at a wrong place is 0.6 easily, and 0.8 in a corridor. But there each scan pulls the
    pose elsewhere: by 0.6 m a metre of way, at the right place by 0.1, with the worst odometry 0.25.
    """

    def __init__(self, *, vouched: bool) -> None:
        """Begin at a place that a person or a mapper has vouched for, or that a search has found."""
        self.proven = vouched
        self._share = 1.0
        self._begin()

    def _begin(self) -> None:
        self._fits: deque[float] = deque(maxlen=WINDOW)
        self._steps: deque[tuple[float, float]] = deque(maxlen=WINDOW - 1)  # way, and off it [m]
        self._way_m, self._clear = 0.0, False

    def add(self, fit: float, share: float, way_m: float, off_m: float) -> None:
        """Take a weighed scan, the share of the weight that is here, and the step since the one before."""
        if off_m > LEAP_M and not self.proven:
            self._begin()
        if self._fits:
            self._way_m += way_m
            self._steps.append((max(way_m, LEAST_WAY_M), off_m))
        self._fits.append(fit)
        self._share = share
        self._clear = self._clear or self._support() >= self._needed()
        enough = len(self._fits) >= LOOKS and self._way_m >= WAY_M
        self.proven = self.proven or (enough and self._support() >= HOLDS and share >= SURE_SHARE)

    @property
    def refuted(self) -> bool:
        """Whether this is the wrong place, or the map has changed beyond recognition."""
        if self.proven:
            return len(self._fits) >= WINDOW and self._mean() < REFUTED
        return len(self._fits) >= LOOKS and self._support() < REFUTED

    @property
    def weak(self) -> str:
        """Why the place should not be believed yet."""
        needed = self._needed()
        if not self._fits or self.proven or self._support() >= needed:
            return ""
        return f"the scans speak for the best place by {self._support():.2f}; {needed:.2f} would be clear"

    @property
    def doubt(self) -> str:
        """Why nobody should drive by this place; empty while one may."""
        if self._share < SURE_SHARE:
            return f"several places look like this one: {100.0 * self._share:.0f} % speak for the best"
        return self.weak

    def _needed(self) -> float:
        """Support that is believed: one look must show more than ten; what was clear once need only hold."""
        looks = LOOKS if self._clear else min(LOOKS, len(self._fits))
        return CLEAR + (HOLDS - CLEAR) * (looks - 1) / (LOOKS - 1)

    def _mean(self) -> float:
        return sum(self._fits) / len(self._fits)

    def _support(self) -> float:
        if not self._steps:
            return self._mean()
        return self._mean() - sum(off_m for _, off_m in self._steps) / sum(way_m for way_m, _ in self._steps)
