"""Whether the scans weighed at one place support it: to trust it, to drive by it, to map from it."""

import math
from collections import deque

WINDOW = 20  # weighed scans that count
CLEAR_SUPPORT = 0.8  # support that one scan needs for the place to be trusted at once
CONFIRMED_SUPPORT = 0.6  # support that confirms the place after ...
MIN_SCANS, MIN_DISTANCE_M = 10, 1.0  # ... this many scans over this distance
REJECTED_BELOW = 0.45  # support of an unconfirmed place, or mean fit of a confirmed one, that rejects it
JUMP_M = 0.5  # off odometry's prediction: the scans before were at another place
MIN_STEP_M = 0.1  # a scan counts as at least this distance: each match moves the pose by some centimetres
MIN_SHARE = 0.8  # share of the particles' weight that one place must have


class PoseTrust:
    """Trust in one place, from its support.

    Support is the mean fit of the scans minus their push off odometry, in metres per metre driven. At a wrong
    place the fit of a scan is easily 0.6, and 0.8 in a corridor. But there each scan pulls the pose somewhere
    else: by 0.6 m per metre. At the right place it is 0.1, and 0.25 with the worst odometry.
    """

    def __init__(self, *, trusted: bool) -> None:
        """Start at a place given by the user or the mapper (`trusted`), or at one that a search has found."""
        self.confirmed = trusted
        self.proven = False  # confirmed by scans, whoever gave the place
        self._share = 1.0
        self._fits: deque[float] = deque(maxlen=WINDOW)
        self._steps: deque[tuple[float, float]] = deque(maxlen=WINDOW - 1)  # distance, and push [m]
        self._distance_m, self._was_clear = 0.0, False

    def update(self, fit: float, share: float, distance_m: float, push_m: float) -> None:
        """Add a weighed scan: its fit, the place's share of the weight, and the step since the last scan."""
        if push_m > JUMP_M and not self.confirmed:
            self._restart()
        if self._fits:
            self._distance_m += distance_m
            self._steps.append((max(distance_m, MIN_STEP_M), push_m))
        self._fits.append(fit)
        self._share = share
        self._was_clear = self._was_clear or self._support() >= self._needed_support()
        enough = len(self._fits) >= MIN_SCANS and self._distance_m >= MIN_DISTANCE_M
        supported = enough and self._support() >= CONFIRMED_SUPPORT and share >= MIN_SHARE
        self.proven = self.proven or supported
        self.confirmed = self.confirmed or supported

    def _restart(self) -> None:
        """Discard the scans so far."""
        self._fits.clear()
        self._steps.clear()
        self._distance_m, self._was_clear = 0.0, False

    @property
    def weighed(self) -> bool:
        """Whether a scan was weighed at this place."""
        return bool(self._fits)

    @property
    def rejected(self) -> bool:
        """Whether this is the wrong place, or the map has changed beyond recognition."""
        if self.confirmed:
            return len(self._fits) >= WINDOW and self._mean_fit() < REJECTED_BELOW
        return len(self._fits) >= MIN_SCANS and self._support() < REJECTED_BELOW

    @property
    def unconfirmed(self) -> str:
        """Why the place is not trusted yet; empty if it is."""
        needed = self._needed_support()
        if not self._fits or self.confirmed or self._support() >= needed:
            return ""
        if self._support() < 0.0:
            return "the scans contradict the best place on the map"
        # Rounded apart, so that they never look equal; the need may lie above its percent by rounding alone.
        support, needed = math.floor(100.0 * self._support()), math.ceil(100.0 * needed - 1e-9)
        return f"the scans support the best place by only {support} %; it needs {needed} %"

    @property
    def doubt(self) -> str:
        """Why the robot must not drive by this place; empty while it may."""
        if self._share < MIN_SHARE:
            return f"several places look alike: {100.0 * self._share:.0f} % of the weight is at the best one"
        return self.unconfirmed

    def _needed_support(self) -> float:
        """Return the support for trust: one scan must show more than ten; a clear place need only hold."""
        scans = MIN_SCANS if self._was_clear else min(MIN_SCANS, len(self._fits))
        return CLEAR_SUPPORT + (CONFIRMED_SUPPORT - CLEAR_SUPPORT) * (scans - 1) / (MIN_SCANS - 1)

    def _mean_fit(self) -> float:
        return sum(self._fits) / len(self._fits)

    def _support(self) -> float:
        if not self._fits:
            return 0.0
        if not self._steps:
            return self._mean_fit()
        push_m = sum(push for _, push in self._steps)
        return self._mean_fit() - push_m / sum(distance for distance, _ in self._steps)
