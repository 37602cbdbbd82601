"""Whether a goal without a path may become reachable again: only through space that was once free."""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import Pose2
from thumper.common.resumable import BAND_CELLS, SlicedSearch
from thumper.navigation.costmap.costmap import Costmap, part_of, square_around
from thumper.navigation.costmap.inflation import FREE, INSCRIBED, ByteArray, IntArray
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.planner import Planner, PlanResult

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
        self._free: NDArray[np.bool_] = np.empty((0, 0), np.bool_)
        self._origin_m, self._resolution_m = np.zeros(2), 0.0
        self._next_row, self._updated_s = 0, -np.inf
        self._is_first_pass = True
        self._search = SlicedSearch[PlanResult]()
        self._unreachable = False

    def update(
        self, time_s: float, costmap: Costmap, static_band: Callable[[int, int], Costmap] | None = None
    ) -> None:
        """Remember the space that is free now: a band of rows in each cycle, each row once per second.

        `static_band` returns the rows between two indices of the costmap without scan and memory, whose
        obstacles may have moved since. They count in the first pass.
        """
        self._lay_out_as(costmap)
        rows, cols = costmap.costs.shape
        if self._next_row >= rows:
            if time_s - self._updated_s < UPDATE_PERIOD_S:
                return
            self._next_row, self._is_first_pass = 0, False
        if self._next_row == 0:
            self._updated_s = time_s
        end = min(rows, self._next_row + max(1, BAND_CELLS // cols))
        band = slice(self._next_row, end)
        self._free[band] |= self._wide(costmap.squared_cells[band], costmap.costs[band])
        if self._is_first_pass and static_band is not None:
            static = static_band(self._next_row, end)
            self._free[band] |= self._wide(static.squared_cells, static.costs)
        self._next_row = end

    def is_unreachable(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> bool:
        """Return whether there would be no path even if all remembered space were still free.

        In a large map the answer takes several calls. Until then it is the last one; at first, False.
        """
        if self._is_first_pass and self._next_row < costmap.costs.shape[0]:
            return False
        if not self._search.is_running:
            optimistic = self.optimistic_costmap(costmap)
            self._search.start(self._planner.search(optimistic, map_from_base, goal))
        result = self._search.advance()
        if result is not None:
            self._unreachable = result.unreachable
        return self._unreachable

    def optimistic_costmap(self, costmap: Costmap) -> Costmap:
        """Return the costmap with all remembered space free."""
        self._lay_out_as(costmap)
        costs = np.where(self._free, np.uint8(FREE), costmap.costs)
        return dataclasses.replace(costmap, costs=costs)

    def optimistic_around(self, costmap: Costmap, goal: Goal, radius_m: float) -> Costmap:
        """Return the part of `optimistic_costmap` round a goal."""
        self._lay_out_as(costmap)
        rows, cols = square_around(costmap, goal.x_m, goal.y_m, radius_m)
        part = part_of(costmap, rows, cols)
        costs = np.where(self._free[rows, cols], np.uint8(FREE), part.costs)
        return dataclasses.replace(part, costs=costs)

    def _wide(self, squared_cells: IntArray, costs: ByteArray) -> NDArray[np.bool_]:
        wide: NDArray[np.bool_] = squared_cells >= (self._wide_m / self._resolution_m) ** 2
        return wide & (costs < INSCRIBED)

    def _lay_out_as(self, costmap: Costmap) -> None:
        """Lay out the remembered space as a costmap, which may have grown or shrunk."""
        same_cells = self._resolution_m == costmap.resolution_m
        if (
            same_cells
            and self._free.shape == costmap.costs.shape
            and (self._origin_m == costmap.origin_m).all()
        ):
            return
        kept = np.zeros(costmap.costs.shape, np.bool_)
        if same_cells:
            left, bottom = np.rint((self._origin_m - costmap.origin_m) / costmap.resolution_m).astype(int)
            (old_height, old_width), (height, width) = self._free.shape, costmap.costs.shape
            new_rows, old_rows = _overlap(int(bottom), old_height, height)
            new_cols, old_cols = _overlap(int(left), old_width, width)
            kept[new_rows, new_cols] = self._free[old_rows, old_cols]
        self._free, self._next_row = kept, 0
        self._origin_m, self._resolution_m = costmap.origin_m, costmap.resolution_m


def _overlap(offset: int, old_count: int, new_count: int) -> tuple[slice, slice]:
    """Return the part of the new and of the old rows that both have; row 0 of the old is new row `offset`."""
    begin, end = max(0, offset), max(0, offset, min(new_count, offset + old_count))
    return slice(begin, end), slice(begin - offset, end - offset)
