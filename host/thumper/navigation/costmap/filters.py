"""Costmap filters: masks of where the robot must not drive, and where it must drive slowly.

Format: map_server's PGM and YAML (http://wiki.ros.org/map_server), as Nav2's costmap filters read them. In
mode `trinary` a cell is 100, 0 or unknown by the thresholds. In mode `scale` it is its darkness between the
two thresholds in percent. In mode `raw` it is the pixel's value. A mask may have another extent and
resolution than the map. It has no effect where it has no cells or its cells are unknown.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.maps.map_server_io import read_occupancy
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

KEEPOUT_PERCENT = 65  # at and above this a keep-out mask closes a cell; map_server's usual threshold
MODES = ("trinary", "scale", "raw")


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapFilterOptions:
    """Files that limit where and how fast the robot drives."""

    # YAML of a keep-out mask: its occupied cells are obstacles for planner and controller; empty: none.
    keepout: str = ""
    # YAML of a speed mask: each cell reduces the top speed by its percentage; empty: none.
    speed: str = ""


Masks = tuple[OccupancyGrid, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapFilters:
    """The masks, loaded. Each keep-out mask closes its cells; the lowest speed of all speed masks counts."""

    keepout: Masks = ()
    speed: Masks = ()

    def __add__(self, other: "CostmapFilters") -> "CostmapFilters":
        return CostmapFilters(keepout=self.keepout + other.keepout, speed=self.speed + other.speed)


def load_masks(options: CostmapFilterOptions) -> CostmapFilters:
    """Read the files that the options name. Raises ThumperError, with exit code 2, if one is invalid."""
    keepout, speed = ((load_mask(Path(name)),) if name else () for name in (options.keepout, options.speed))
    return CostmapFilters(keepout=keepout, speed=speed)


def load_mask(yaml_path: Path) -> OccupancyGrid:
    """Read a mask: cells from 0 to 100, -1 where it has no effect.

    Raises
    ------
    ThumperError
        A file is missing or invalid; the message names the file, the key and the value.
    """
    metadata, dark = read_occupancy(yaml_path, MODES)
    if metadata.mode == "raw":
        pixels = np.rint(dark * 255.0 if metadata.negate else (1.0 - dark) * 255.0)
        cells = np.where(pixels <= OCCUPIED, pixels, UNKNOWN)
    else:
        fraction = (dark - metadata.free_thresh) / (metadata.occupied_thresh - metadata.free_thresh)
        between = np.rint(OCCUPIED * fraction) if metadata.mode == "scale" else np.float64(UNKNOWN)
        cells = np.where(
            dark > metadata.occupied_thresh, OCCUPIED, np.where(dark < metadata.free_thresh, FREE, between)
        )
    return OccupancyGrid(
        cells=cells.astype(np.int8),
        resolution_m=metadata.resolution_m,
        origin_x_m=metadata.origin_x_m,
        origin_y_m=metadata.origin_y_m,
    )


def keepout_cells(keepout: Masks, grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Return which cells of a grid have their centre in a keep-out zone, shape (rows, cols)."""
    closed = np.zeros(grid.cells.shape, np.bool_)
    rows, cols = grid.cells.shape
    for mask in keepout:
        row = _index(grid.origin_y_m, grid.resolution_m, rows, mask.origin_y_m, mask.resolution_m)
        col = _index(grid.origin_x_m, grid.resolution_m, cols, mask.origin_x_m, mask.resolution_m)
        row_in = np.flatnonzero((row >= 0) & (row < mask.cells.shape[0]))
        col_in = np.flatnonzero((col >= 0) & (col < mask.cells.shape[1]))
        if len(row_in) and len(col_in):  # both are runs of neighbours
            chosen = mask.cells[np.ix_(row[row_in], col[col_in])] >= KEEPOUT_PERCENT
            closed[row_in[0] : row_in[-1] + 1, col_in[0] : col_in[-1] + 1] |= chosen
    return closed


def with_keepout(grid: OccupancyGrid, keepout: Masks) -> OccupancyGrid:
    """Return the grid with the cells of keep-out zones occupied, for searches that know no masks."""
    if not keepout:
        return grid
    return replace(grid, cells=np.where(keepout_cells(keepout, grid), OCCUPIED, grid.cells).astype(np.int8))


def is_kept_out(keepout: Masks, x_m: float, y_m: float) -> bool:
    """Return whether a place is in a keep-out zone."""
    for mask in keepout:
        row, col = mask.cell_of(x_m, y_m)
        if mask.contains(row, col) and mask.cells[row, col] >= KEEPOUT_PERCENT:
            return True
    return False


def _index(
    origin_m: float, cell_m: float, count: int, mask_origin_m: float, mask_cell_m: float
) -> NDArray[np.int64]:
    """Return the mask's row or column under each of `count` cell centres, shape (count,)."""
    centres_m = origin_m + (np.arange(count) + 0.5) * cell_m
    index: NDArray[np.int64] = np.floor((centres_m - mask_origin_m) / mask_cell_m + 1e-9).astype(np.int64)
    return index


def speed_fractions(speed: Masks, points_m: FloatArray) -> FloatArray:
    """Return the fraction of the top speed that masks allow at points, shape (n, 2) [m]; shape (n,)."""
    fractions = np.ones(len(points_m))
    for mask in speed:
        percent = mask.values_at(points_m)
        allowed = np.where(percent == UNKNOWN, 1.0, 1.0 - percent / OCCUPIED)
        fractions = np.minimum(fractions, allowed)
    return fractions
