"""A map drawn from the scans that the places keep, some at a time: a robot cannot wait for all of them."""

from dataclasses import dataclass

from thumper.slam.grid.growing_grid import Cells
from thumper.slam.pose_graph.submaps import PlaceGraph


@dataclass(slots=True, kw_only=True)
class Drawing:
    """A map under way."""

    cells: Cells
    chosen: set[int] | None = None  # places; None for all
    entered: int = 0  # kept scans looked at so far

    def draw(self, places: PlaceGraph, most: int) -> bool:
        """Enter `most` more; whether it holds all there are."""
        self.entered = places.enter(self.cells, self.entered, self.chosen, most)
        return self.entered == len(places.scans)
