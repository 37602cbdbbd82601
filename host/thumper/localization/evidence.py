"""What the scans weighed at one place say for it: whether to believe it, drive by it, map from it."""

from collections import deque

WINDOW = 20  # weighed scans that count
CLEAR = 0.7  # fit of a first look at which nobody needs to wait for a second ...
HOLDS, LOOKS, WAY_M = 0.65, 10, 1.0  # ... and of so many over so much way: the place is proven
REFUTED = 0.45  # mean fit at which the place is given up
SURE_SHARE = 0.8  # of the weight, that one place must have


class Evidence:
    """The fit of a scan is the share explained by walls, less the share of beams that pass through walls.

    A wrong place explains 0.6 of a scan easily, but there beams pass through walls: along a way in an office
    the mean fit is 0.6...1 at the right place, and at a wrong one below 0.4.
    """

    def __init__(self, *, vouched: bool) -> None:
        """Begin at a place that a person or a mapper has vouched for, or that a search has found."""
        self.proven = vouched
        self._fits: deque[float] = deque(maxlen=WINDOW)
        self._way_m, self._share, self._clear = 0.0, 1.0, False

    def add(self, fit: float, way_m: float, share: float) -> None:
        """Take a weighed scan, the way since the one before, and the share of the weight that is here."""
        self._way_m += way_m if self._fits else 0.0
        self._fits.append(fit)
        self._share = share
        self._clear = self._clear or self._mean() >= self._needed()
        enough = len(self._fits) >= LOOKS and self._way_m >= WAY_M
        self.proven = self.proven or (enough and self._mean() >= HOLDS and share >= SURE_SHARE)

    @property
    def refuted(self) -> bool:
        """Whether this is the wrong place, or the map has changed beyond recognition."""
        return len(self._fits) >= (WINDOW if self.proven else LOOKS) and self._mean() < REFUTED

    @property
    def weak(self) -> str:
        """Why the place should not be believed yet."""
        needed = self._needed()
        if not self._fits or self.proven or self._mean() >= needed:
            return ""
        return f"the best place fits {100.0 * self._mean():.0f} %, {100.0 * needed:.0f} % would be clear"

    @property
    def doubt(self) -> str:
        """Why nobody should drive by this place; empty while one may."""
        if self._share < SURE_SHARE:
            return f"several places look like this one: {100.0 * self._share:.0f} % speak for the best"
        return self.weak

    def _needed(self) -> float:
        """Mean fit to be believed: one look must show more than ten; what was clear once need only hold."""
        looks = LOOKS if self._clear else min(LOOKS, len(self._fits))
        return CLEAR + (HOLDS - CLEAR) * (looks - 1) / (LOOKS - 1)

    def _mean(self) -> float:
        return sum(self._fits) / len(self._fits)
