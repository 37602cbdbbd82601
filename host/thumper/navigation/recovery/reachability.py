"""Whether a way that is not there may come back: it may, if the ground was once seen open."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import FREE, INSCRIBED
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.planner import Planner

NOTE_PERIOD_S = 1.0


class Reachability:
    """Keeps all ground seen free, and wide enough, on the way to a goal; the map may grow meanwhile.

    A way through a door that somebody has shut, or stands in, was open, and forgetting or waiting may bring
    it back. One through ground never seen was but a hope, and once walls are seen there it is gone. A
    gap in which the robot could not even turn is none: noise opens and shuts it.
    """

    def __init__(self, planner: Planner, footprint: Footprint) -> None:
        self._planner = planner
        self._wide_m = footprint.circumscribed_radius_m
        self.reset()

    def reset(self) -> None:
        """Forget all (a new goal)."""
        self._open: NDArray[np.bool_] = np.empty((0, 0), np.bool_)  # laid out as `_costmap`
        self._costmap: Costmap | None = None
        self._noted_s = -np.inf

    @property
    def are_unasked(self) -> bool:
        """Whether nothing was noted since the last reset."""
        return self._costmap is None

    def note(self, time_s: float, costmap: Costmap) -> None:
        """Add what is open now, once a second."""
        if time_s - self._noted_s >= NOTE_PERIOD_S:
            wide = costmap.squared_cells >= (self._wide_m / costmap.resolution_m) ** 2
            self._open = self._on_cells_of(costmap) | (wide & (costmap.costs < INSCRIBED))
            self._costmap, self._noted_s = costmap, time_s

    def are_none(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> bool:
        """Whether there would be no way even if all that once was open still were."""
        return self._planner.plan(self.at_best(costmap), map_from_base, goal).closed

    def at_best(self, costmap: Costmap) -> Costmap:
        """The costmap with all free that once was open."""
        costs = np.where(self._on_cells_of(costmap), np.uint8(FREE), costmap.costs)
        return dataclasses.replace(costmap, costs=costs)

    def _on_cells_of(self, costmap: Costmap) -> NDArray[np.bool_]:
        """What is kept, shape as the costs; a map may grow or shrink by whole cells on any side."""
        kept = np.zeros(costmap.costs.shape, np.bool_)
        old = self._costmap
        if old is None or old.resolution_m != costmap.resolution_m:
            return kept
        left, bottom = np.rint((old.origin_m - costmap.origin_m) / costmap.resolution_m).astype(int)
        if (left, bottom) == (0, 0) and self._open.shape == kept.shape:
            return self._open
        cells = np.argwhere(self._open) + np.array((bottom, left))
        rows, cols = cells[((cells >= 0) & (cells < costmap.costs.shape)).all(axis=1)].T
        kept[rows, cols] = True
        return kept
