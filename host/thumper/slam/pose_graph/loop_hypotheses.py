"""Where the drive may have come back to: closures that agree, until one place leads clearly.

One closure proves little, because places look alike. So closures of several submaps must move the map
alike, and explain more than all other places. An ambiguous or failed search alone does not drop a place.
"""

import math
from dataclasses import dataclass, field

from thumper.common.geometry import Pose2

AGREE_M, AGREE_RAD = 0.3, 0.05  # two closures of one loop agree this closely ...
AGREE_PER_M, AGREE_RAD_PER_M = 0.02, 0.003  # ... and less, as the map drifts between their submaps
LEAD = 0.3  # sum of the leads of closures that agree
CLEAR_LEAD = 0.05  # a closure with less counts, but along a corridor it may be off: it gets no edge
MIN_CLEAR = 2  # one closure proves little
MAX_MISSES = 3  # searches without a closure that agrees, after which a place is dropped


@dataclass(frozen=True, slots=True, kw_only=True)
class Closure:
    """The pose of a new submap, found on the map of an old one."""

    old: int
    new: int
    old_from_new: Pose2
    shift: Pose2  # motion of the map at the new submap if the closure is accepted
    lead: float  # share of the beams that it explains beyond any other pose of the window


@dataclass(slots=True)
class LoopHypothesis:
    """Closures that agree, oldest first."""

    closures: list[Closure]
    misses: int = 0  # searches since the newest

    @property
    def lead(self) -> float:
        """Sum of the leads."""
        return sum(closure.lead for closure in self.closures)

    @property
    def clearest(self) -> Closure:
        """The closure that leads most."""
        return max(self.closures, key=lambda each: each.lead)

    @property
    def shift(self) -> Pose2:
        """Motion of the map by the clearest closure."""
        return self.clearest.shift

    def agrees(self, other: Closure, here: Pose2, way_m: float) -> bool:
        """Return whether a closure at `here`, driven `way_m` after the clearest, moves the map alike."""
        apart = (self.shift @ here).inverse() @ other.shift @ here
        distance_m, turn_rad = math.hypot(apart.x_m, apart.y_m), abs(apart.theta_rad)
        return distance_m < AGREE_M + AGREE_PER_M * way_m and turn_rad < AGREE_RAD + AGREE_RAD_PER_M * way_m


@dataclass(slots=True)
class LoopHypotheses:
    """All places that the drive may have come back to."""

    all: list[LoopHypothesis] = field(default_factory=list)

    @property
    def best(self) -> LoopHypothesis | None:
        """The place that leads; None if there is none."""
        return max(self.all, key=lambda each: each.lead, default=None)

    def miss(self) -> None:
        """Count a search that found nothing; drop the places without support for too long."""
        for each in self.all:
            each.misses += 1
        self.all = [each for each in self.all if each.misses < MAX_MISSES]

    def add(self, found: Closure | None, here: Pose2, way_m: dict[int, float]) -> list[Closure]:
        """Add the result of a search at the pose `here`; return the closures of a place that leads clearly.

        `way_m` is the distance driven to `here` from the submap of each hypothesis' clearest closure.
        """
        supported = None
        for each in self.all:
            if found and supported is None and each.agrees(found, here, way_m[each.clearest.new]):
                each.closures.append(found)
                each.misses, supported = -1, each
        if found and supported is None:
            self.all.append(LoopHypothesis([found], misses=-1))
        self.miss()
        if supported is None:
            return []
        others = max((each.lead for each in self.all if each is not supported), default=0.0)
        if supported.lead < LEAD + others:
            return []
        clear = [each for each in supported.closures if each.lead >= CLEAR_LEAD]
        if len(clear) < MIN_CLEAR:
            return []
        self.all = []
        return clear
