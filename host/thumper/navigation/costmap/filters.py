"""Costmap filters: masks of where the robot must not drive, and where it must drive slowly.

Format: map_server's PGM and YAML (http://wiki.ros.org/map_server), as Nav2's costmap filters read them. In
mode `trinary` a cell is 100, 0 or unknown by the thresholds. In mode `scale` it is its darkness between the
two thresholds in percent. In mode `raw` it is the pixel's value. A mask may have another extent and
resolution than the map. It has no effect where it has no cells or its cells are unknown.
"""

from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapFilters:
    """The masks, loaded; None for a mask that is not configured."""

    keepout: OccupancyGrid | None = None
    speed: OccupancyGrid | None = None


def load_masks(options: CostmapFilterOptions) -> CostmapFilters:
    """Read the files that the options name. Raises ThumperError, with exit code 2, if one is invalid."""
    keepout, speed = (load_mask(Path(name)) if name else None for name in (options.keepout, options.speed))
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


def keepout_cells(keepout: OccupancyGrid | None, grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Return which cells of a grid have their centre in a keep-out zone, shape (rows, cols)."""
    closed = np.zeros(grid.cells.shape, np.bool_)
    if keepout is None:
        return closed
    rows, cols = grid.cells.shape
    row = _index(grid.origin_y_m, grid.resolution_m, rows, keepout.origin_y_m, keepout.resolution_m)
    col = _index(grid.origin_x_m, grid.resolution_m, cols, keepout.origin_x_m, keepout.resolution_m)
    row_in = (row >= 0) & (row < keepout.cells.shape[0])
    col_in = (col >= 0) & (col < keepout.cells.shape[1])
    chosen = keepout.cells[np.ix_(row[row_in], col[col_in])] >= KEEPOUT_PERCENT
    closed[np.ix_(row_in, col_in)] = chosen
    return closed


def _index(
    origin_m: float, cell_m: float, count: int, mask_origin_m: float, mask_cell_m: float
) -> NDArray[np.int64]:
    """Return the mask's row or column under each of `count` cell centres, shape (count,)."""
    centres_m = origin_m + (np.arange(count) + 0.5) * cell_m
    index: NDArray[np.int64] = np.floor((centres_m - mask_origin_m) / mask_cell_m + 1e-9).astype(np.int64)
    return index


def speed_fractions(speed: OccupancyGrid, points_m: FloatArray) -> FloatArray:
    """Return the fraction of the top speed that a mask allows at points, shape (n, 2) [m]; shape (n,)."""
    cells = np.floor((points_m - (speed.origin_x_m, speed.origin_y_m)) / speed.resolution_m).astype(np.int64)
    inside = (cells >= 0).all(axis=1) & (cells < speed.cells.shape[::-1]).all(axis=1)
    fractions = np.ones(len(points_m))
    percent = speed.cells[cells[inside, 1], cells[inside, 0]]
    fractions[inside] = np.where(percent == UNKNOWN, 1.0, 1.0 - percent / OCCUPIED)
    return fractions
