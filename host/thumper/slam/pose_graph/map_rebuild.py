"""Rebuild a map from the scans kept in the submaps, a few per call: a robot cannot wait for all."""

import math
from dataclasses import dataclass

from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.submaps import SubmapGraph

CELLS_PER_PART = 100_000  # that the beams inserted in one part of the work cross, about: 1 ms


@dataclass(slots=True, kw_only=True)
class MapRebuild:
    """A map under construction."""

    hit_grid: HitGrid
    chosen: set[int] | None = None  # submaps to insert; None for all
    range_m: float = math.inf  # longer beams are left out
    next_scan: int = 0  # the first kept scan not looked at yet

    def insert_part(self, submaps: SubmapGraph) -> bool:
        """Insert some more scans, one at least, and return whether the map is complete."""
        way_m = CELLS_PER_PART * self.hit_grid.resolution_m
        self.next_scan = submaps.insert_scans(self.hit_grid, self.next_scan, self.chosen, way_m, self.range_m)
        return self.next_scan == len(submaps.scans)
