"""Count how often a navigator's path changes sides: whether it passes obstacles left or right.

Two paths between the same ends pass an obstacle on different sides if the loop that they form winds round it
(their homotopy class differs).
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray


class RouteChanges(NamedTuple):
    """How often the path of a drive changed sides."""

    changes: int  # some obstacle is passed on another side than before
    flips: int  # of these: some obstacle is passed again on a side that the path had left


def count_route_changes(plans: Iterable[FloatArray], obstacles_m: FloatArray) -> RouteChanges:
    """Count the changes between the plans of a drive, shape (n, 2) [m] each, one per cycle.

    `obstacles_m`, shape (k, 2), has a point of each obstacle. Cycles without a plan are skipped.
    """
    sides = np.zeros(len(obstacles_m), np.int64)
    earlier: list[NDArray[np.int64]] = [sides]
    changes = flips = 0
    last_m: FloatArray = np.empty((0, 2))
    for plan_m in plans:
        if len(plan_m) == 0:
            continue
        if len(last_m) and not _is_rest_of(plan_m, last_m):
            turns = winding_numbers(np.vstack((last_m, plan_m[::-1])), obstacles_m)
            if turns.any():
                sides = sides + turns
                changes += 1
                flips += bool((np.array(earlier) == sides)[:, turns != 0].any())
                earlier.append(sides)
        last_m = plan_m
    return RouteChanges(changes, flips)


def _is_rest_of(plan_m: FloatArray, whole_m: FloatArray) -> bool:
    """Return whether a plan is the last part of another."""
    return len(plan_m) <= len(whole_m) and np.array_equal(plan_m, whole_m[-len(plan_m) :])


def winding_numbers(loop: FloatArray, points: FloatArray) -> NDArray[np.int64]:
    """Return how often a closed polyline, shape (n, 2), winds round each point, shape (k, 2)."""
    after = np.roll(loop, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    upward = (loop[:, 1] <= y) & (after[:, 1] > y)
    downward = (loop[:, 1] > y) & (after[:, 1] <= y)
    step = after - loop
    left = step[:, 0] * (y - loop[:, 1]) - step[:, 1] * (x - loop[:, 0])
    counts: NDArray[np.int64] = (upward & (left > 0.0)).sum(1) - (downward & (left < 0.0)).sum(1)
    return counts
