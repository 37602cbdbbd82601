"""A map drawn from the scans that the places keep, some at a time: a robot cannot wait for all of them."""

from dataclasses import dataclass

from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.submaps import SubmapGraph


@dataclass(slots=True, kw_only=True)
class MapRebuild:
    """A map under way."""

    cells: HitGrid
    chosen: set[int] | None = None  # places; None for all
    entered: int = 0  # kept scans looked at so far

    def draw(self, places: SubmapGraph, most: int) -> bool:
        """Enter `most` more; whether it holds all there are."""
        self.entered = places.enter(self.cells, self.entered, self.chosen, most)
        return self.entered == len(places.scans)
