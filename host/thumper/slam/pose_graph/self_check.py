"""Whether a map agrees with itself: a place that was visited twice must show the same walls both times.

Where a loop was not found, the second visit is drawn beside the first one, or across it.
"""

import itertools
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import Pose2
from thumper.slam.pose_graph.submaps import SubmapGraph

APART_M = 60.0  # driven between two visits
NEAR_M, NEAR_RAD = 3.0, 1.0  # between two poses that show the same place ...
MIN_AGREEMENT = 0.5  # ... so that this share of the walls near those of the other visit lies on them
MIN_TORN_M = 10.0  # driven without a break, that no wall between two rooms and no moved furniture explains


class Contradiction(NamedTuple):
    """A stretch of the drive whose walls are not those of an earlier visit to the same place."""

    length_m: float
    x_m: float  # where it begins
    y_m: float

    @property
    def text(self) -> str:
        """One line for the user."""
        return (
            f"the map contradicts itself along {self.length_m:.0f} m of the drive, first at "
            f"({self.x_m:.1f}, {self.y_m:.1f}): a place may be drawn twice, because a loop was not found "
            "(or these are both sides of a thick wall)"
        )


def find_contradiction(submaps: SubmapGraph) -> Contradiction | None:
    """Return where the map contradicts itself; None if no stretch of at least `MIN_TORN_M` does."""
    total_m, first = 0.0, Pose2()
    for is_torn, group in itertools.groupby(range(1, submaps.newest), lambda new: _is_torn(submaps, new)):
        stretch = list(group)
        length_m = submaps.path_length_m(stretch[0], stretch[-1] + 1)
        if is_torn and length_m >= MIN_TORN_M:
            first = first if total_m else submaps.pose(stretch[0])
            total_m += length_m
    return Contradiction(total_m, first.x_m, first.y_m) if total_m else None


def _is_torn(submaps: SubmapGraph, new: int) -> bool:
    """Return whether the walls of a submap are not those of the nearest one of an earlier visit.

    Where nothing can be compared (NaN), nothing is torn.
    """
    nearest = earlier_visit(submaps, new)
    return nearest is not None and submaps.agreement(nearest, new) < MIN_AGREEMENT


def earlier_visit(submaps: SubmapGraph, new: int) -> int | None:
    """Return the nearest submap that shows the same place, driven through long before."""
    old = np.arange(new)
    old = old[submaps.path_lengths_m(old, new) > APART_M]
    if not old.size:
        return None
    apart = submaps.poses[old] - submaps.poses[new]
    distance_m, turn_rad = np.hypot(apart[:, 0], apart[:, 1]), np.abs(np.sin(apart[:, 2]))
    distance_m[turn_rad > np.sin(NEAR_RAD)] = np.inf  # seen in the same direction, or in the opposite one
    nearest = int(np.argmin(distance_m))
    return int(old[nearest]) if distance_m[nearest] < NEAR_M else None
