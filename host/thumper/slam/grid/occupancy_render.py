"""Render hit counts as an occupancy grid; the work grows with the cells that scans have crossed."""

import sys
from dataclasses import replace
from typing import NamedTuple

from thumper.common.numba_kernel import kernel
from thumper.maps.cell_changes import NO_CELLS, CellBox, RenderHistory
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, CellArray, OccupancyGrid
from thumper.slam.scan_matching.distance_field import CountArray, is_occupied

KEPT_RENDERS = 3
UNUSED = 2  # references to an array that only its render has: the attribute and the argument of the count


@kernel
def render_occupancy(
    hits: CountArray, misses: CountArray, occupied_fraction: float, box: CellBox, cells: CellArray
) -> CellBox:
    """Set `cells`, shape (rows, columns), to free, occupied or unknown inside a box.

    Returns the box round the cells that changed.
    """
    rows, cols = cells.shape
    top, left, bottom, right = rows, cols, 0, 0
    for row in range(max(0, box.top), min(rows, box.bottom)):
        for col in range(max(0, box.left), min(cols, box.right)):
            known = hits[row, col] > 0 or misses[row, col] > 0
            occupied = is_occupied(hits[row, col], misses[row, col], occupied_fraction)
            state = OCCUPIED if occupied else FREE if known else UNKNOWN
            if cells[row, col] != state:
                cells[row, col] = state
                top, bottom = min(top, row), max(bottom, row + 1)
                left, right = min(left, col), max(right, col + 1)
    return CellBox(top, left, bottom, right)


class _Render(NamedTuple):
    cells: CellArray
    history: RenderHistory


class OccupancyRender:
    """The renders of one map in one extent.

    A grid that was returned never changes: the next one is written to the array of an older grid that nobody
    holds any more, else to a copy.
    """

    def __init__(self, empty: OccupancyGrid, occupied_fraction: float) -> None:
        """`empty` is a grid of unknown cells in the map's layout."""
        self._fraction = occupied_fraction
        self._changed = CellBox(0, 0, *empty.cells.shape)  # crossed by scans since the newest render
        self._renders = [_Render(empty.cells, empty.history)]  # the newest last
        self._newest = empty

    def add_scan(self, crossed: CellBox) -> None:
        """Note the cells whose counts a scan has changed."""
        self._changed = self._changed.union(crossed)

    def grid(self, hits: CountArray, misses: CountArray) -> OccupancyGrid:
        """Return the map by its counts, shape (rows, columns): the same object if no cell differs."""
        if self._changed.is_empty:
            return self._newest
        cells = self._unused_copy()
        changed = render_occupancy(hits, misses, self._fraction, self._changed, cells)
        self._changed = NO_CELLS
        before = self._renders[-1].history
        if changed.is_empty:
            self._renders.insert(0, _Render(cells, before))
            return self._newest
        history = before.next(CellBox(*changed))
        self._renders = [*self._renders[1 - KEPT_RENDERS :], _Render(cells, history)]
        self._newest = replace(self._newest, cells=cells).with_history(history)
        return self._newest

    def _unused_copy(self) -> CellArray:
        """Return a copy of the newest cells, in an older array if one is not in use."""
        newest = self._renders[-1]
        for index, render in enumerate(self._renders[:-1]):
            changed = newest.history.changed_since(render.history)
            del render
            if changed is not None and sys.getrefcount(self._renders[index].cells) == UNUSED:
                cells = self._renders.pop(index).cells
                cells[changed.window] = newest.cells[changed.window]
                return cells
        return newest.cells.copy()
