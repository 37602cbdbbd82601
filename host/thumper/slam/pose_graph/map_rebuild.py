"""Rebuild a map from the scans kept in the submaps, a few per call: a robot cannot wait for all."""

from dataclasses import dataclass

from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.submaps import SubmapGraph

SCANS_PER_PART = 6  # inserted in one part of the work: a few ms


@dataclass(slots=True, kw_only=True)
class MapRebuild:
    """A map under construction."""

    hit_grid: HitGrid
    chosen: set[int] | None = None  # submaps to insert; None for all
    next_scan: int = 0  # the first kept scan not looked at yet

    def insert_part(self, submaps: SubmapGraph) -> bool:
        """Insert up to `SCANS_PER_PART` more scans and return whether the map is complete."""
        self.next_scan = submaps.insert_scans(self.hit_grid, self.next_scan, self.chosen, SCANS_PER_PART)
        return self.next_scan == len(submaps.scans)
