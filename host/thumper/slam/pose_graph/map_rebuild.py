"""Rebuild a map from the scans kept in the submaps, a few per call: a robot cannot wait for all."""

import math
from dataclasses import dataclass

from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.submaps import SubmapGraph

# Cells that the beams inserted in one part of the work cross, about: 1 to 2 ms, with distances and without.
MEASURED_CELLS, COUNTED_CELLS = 90_000, 150_000


@dataclass(slots=True, kw_only=True)
class MapRebuild:
    """A map under construction."""

    hit_grid: HitGrid
    chosen: set[int] | None = None  # submaps to insert; None for all
    range_m: float = math.inf  # longer beams are left out
    next_scan: int = 0  # the first kept scan not looked at yet
    _left_m: float = 0.0  # of the parts' way; below zero where a scan was longer than what was left
    _all_counted: bool = False  # then the deferred distances follow

    def insert_part(self, submaps: SubmapGraph) -> bool:
        """Insert some more scans and return whether the map is complete."""
        if self._all_counted and not self.hit_grid.add_distances():
            return False
        cells = MEASURED_CELLS if self.hit_grid.keeps_distances else COUNTED_CELLS
        self._left_m = min(0.0, self._left_m) + cells * self.hit_grid.resolution_m
        self.next_scan, self._left_m = submaps.insert_scans(
            self.hit_grid, self.next_scan, self.chosen, self._left_m, self.range_m
        )
        is_counted = self.next_scan == len(submaps.scans)
        self._all_counted |= is_counted
        return is_counted and self.hit_grid.add_distances()
