"""Rebuild a map from the scans kept in the submaps, a few per call: a robot cannot wait for all."""

import math
from dataclasses import dataclass, field

from thumper.common.resumable import SlicedSearch
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.submaps import SubmapGraph

CELLS_PER_PART = 100_000  # that the beams inserted in one part of the work cross, about: 1 ms


@dataclass(slots=True, kw_only=True)
class MapRebuild:
    """A map under construction."""

    hit_grid: HitGrid
    chosen: set[int] | None = None  # submaps to insert; None for all
    room_for: set[int] | None = None  # submaps that the map leaves room for, if not those to insert alone
    range_m: float = math.inf  # longer beams are left out
    margin_m: float = 0.0  # around the scans, for those that the robot will insert
    next_scan: int = 0  # the first kept scan not looked at yet
    _reservation: SlicedSearch[None] = field(default_factory=SlicedSearch)

    def insert_part(self, submaps: SubmapGraph) -> bool:
        """Insert some more scans, one at least, and return whether the map is complete."""
        if not self.hit_grid.shape[0] and not self._reservation.is_running:
            low_m, high_m = submaps.bounds_m(self.room_for or self.chosen, self.range_m)
            self._reservation.start(self.hit_grid.reserve(low_m - self.margin_m, high_m + self.margin_m))
        if self._reservation.is_running:
            self._reservation.advance()
            return False
        way_m = CELLS_PER_PART * self.hit_grid.resolution_m
        self.next_scan = submaps.insert_scans(self.hit_grid, self.next_scan, self.chosen, way_m, self.range_m)
        return self.next_scan == len(submaps.scans)
