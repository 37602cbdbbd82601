"""Render hit counts as an occupancy grid; the work grows with the cells that scans have crossed."""

import sys
from dataclasses import replace
from typing import NamedTuple

from thumper.common.numba_kernel import kernel
from thumper.maps.cell_changes import NO_CELLS, CellBox, RenderHistory
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, CellArray, OccupancyGrid
from thumper.slam.scan_matching.distance_field import is_occupied
from thumper.slam.scan_matching.patch_grid import PatchGrid
from thumper.slam.scan_matching.patches import MASK, SIDE, SIDE_BITS

KEPT_RENDERS = 3
UNUSED = 2  # references to an array that only its render has: the attribute and the argument of the count


@kernel
def render_occupancy(source: PatchGrid, occupied_fraction: float, box: CellBox, cells: CellArray) -> CellBox:
    """Set `cells`, shape (rows, columns), to free, occupied or unknown inside a box.

    Returns the box round the cells that changed. Cells without a patch stay as they are.
    """
    rows, cols = cells.shape
    found = CellBox(rows, cols, 0, 0)
    first_row, end_row = max(0, box.top) + source.row, min(rows, box.bottom) + source.row
    first_col, end_col = max(0, box.left) + source.col, min(cols, box.right) + source.col
    for pr in range(first_row >> SIDE_BITS, ((end_row - 1) >> SIDE_BITS) + 1):
        for pc in range(first_col >> SIDE_BITS, ((end_col - 1) >> SIDE_BITS) + 1):
            if source.table[pr, pc] != 0:
                part = CellBox(
                    max(first_row, pr * SIDE) - source.row,
                    max(first_col, pc * SIDE) - source.col,
                    min(end_row, (pr + 1) * SIDE) - source.row,
                    min(end_col, (pc + 1) * SIDE) - source.col,
                )
                found = _render_part(source, occupied_fraction, part, cells, found)
    return found


@kernel
def _render_part(
    source: PatchGrid, occupied_fraction: float, part: CellBox, cells: CellArray, changed: CellBox
) -> CellBox:
    """Render a box of cells inside one patch; return `changed` with the cells that changed."""
    top, left, bottom, right = changed
    r0, c0 = part.top + source.row, part.left + source.col
    patch = source.table[r0 >> SIDE_BITS, c0 >> SIDE_BITS]
    for row in range(part.top, part.bottom):
        for col in range(part.left, part.right):
            r, c = (row + source.row) & MASK, (col + source.col) & MASK
            hits, misses = source.pool.hits[patch, r, c], source.pool.misses[patch, r, c]
            occupied = is_occupied(hits, misses, occupied_fraction)
            state = OCCUPIED if occupied else FREE if hits > 0 or misses > 0 else UNKNOWN
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

    def __init__(self, empty: OccupancyGrid, source: PatchGrid, occupied_fraction: float) -> None:
        """Render the map into `empty`, a grid of unknown cells in its layout."""
        self._fraction = occupied_fraction
        self._changed = NO_CELLS  # crossed by scans since the newest render
        render_occupancy(source, occupied_fraction, CellBox(0, 0, *empty.cells.shape), empty.cells)
        self._renders = [_Render(empty.cells, empty.history)]  # the newest last
        self._newest = empty

    def add_scan(self, crossed: CellBox) -> None:
        """Note the cells whose counts a scan has changed."""
        self._changed = self._changed.union(crossed)

    def grid(self, source: PatchGrid) -> OccupancyGrid:
        """Return the map by its counts: the same object if no cell differs."""
        if self._changed.is_empty:
            return self._newest
        cells = self._unused_copy()
        changed = render_occupancy(source, self._fraction, self._changed, cells)
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
