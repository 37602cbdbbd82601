"""Whether a goal without a path may become reachable again: only through space that was once free."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import FREE, INSCRIBED
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.planner import Planner

UPDATE_PERIOD_S = 1.0


class Reachability:
    """Remembers all space that was free and wide enough on the drive to one goal; the map may grow.

    A path through a door that somebody has closed was free; forgetting or waiting may bring it back. A path
    through unknown space was only assumed, and is gone once walls are seen there. A gap in which the robot
    could not even turn does not count: noise opens and closes it.
    """

    def __init__(self, planner: Planner, footprint: Footprint) -> None:
        self._planner = planner
        self._wide_m = footprint.circumscribed_radius_m
        self._free: NDArray[np.bool_] = np.empty((0, 0), np.bool_)  # laid out as `_costmap`
        self._costmap: Costmap | None = None
        self._updated_s = -np.inf

    @property
    def is_empty(self) -> bool:
        """Whether nothing is remembered yet."""
        return self._costmap is None

    def update(self, time_s: float, costmap: Costmap) -> None:
        """Remember the space that is free now; once per second."""
        if time_s - self._updated_s >= UPDATE_PERIOD_S:
            wide = costmap.squared_cells >= (self._wide_m / costmap.resolution_m) ** 2
            self._free = self._on_cells_of(costmap) | (wide & (costmap.costs < INSCRIBED))
            self._costmap, self._updated_s = costmap, time_s

    def is_unreachable(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> bool:
        """Return whether there would be no path even if all remembered space were still free."""
        return self._planner.plan(self.optimistic_costmap(costmap), map_from_base, goal).unreachable

    def optimistic_costmap(self, costmap: Costmap) -> Costmap:
        """Return the costmap with all remembered space free."""
        costs = np.where(self._on_cells_of(costmap), np.uint8(FREE), costmap.costs)
        return dataclasses.replace(costmap, costs=costs)

    def _on_cells_of(self, costmap: Costmap) -> NDArray[np.bool_]:
        """Return the remembered space in the shape of a costmap, which may have grown or shrunk."""
        kept = np.zeros(costmap.costs.shape, np.bool_)
        old = self._costmap
        if old is None or old.resolution_m != costmap.resolution_m:
            return kept
        left, bottom = np.rint((old.origin_m - costmap.origin_m) / costmap.resolution_m).astype(int)
        if (left, bottom) == (0, 0) and self._free.shape == kept.shape:
            return self._free
        cells = np.argwhere(self._free) + np.array((bottom, left))
        rows, cols = cells[((cells >= 0) & (cells < costmap.costs.shape)).all(axis=1)].T
        kept[rows, cols] = True
        return kept
