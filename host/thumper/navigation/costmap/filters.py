"""Maps that somebody has drawn on: where the robot must not go, and where it must go slowly.

Format: map_server's PGM and YAML (http://wiki.ros.org/map_server), as Nav2's costmap filters take it. In mode
`trinary` a cell is 100, 0 or unknown by the thresholds; in mode `scale` it is its darkness between the two
thresholds in percent; in mode `raw` the pixel is the value. A mask may cover another area, at another
resolution, than the map: what it does not cover, or does not know, it says nothing about.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.maps.map_server_io import read_occupancy
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

KEEP_OUT_PERCENT = 65  # from here a cell of a keep-out mask is closed, as map_server's usual threshold has it
MODES = ("trinary", "scale", "raw")


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapFilterOptions:
    """Files that limit where and how fast the robot drives."""

    # YAML of a keep-out mask: occupied cells are obstacles to planner and controller; empty: none.
    keepout: str = ""
    # YAML of a speed mask: each cell takes its percentage off the fastest speed; empty: none.
    speed: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CostmapFilters:
    """The masks, read; None where there is none."""

    keepout: OccupancyGrid | None = None
    speed: OccupancyGrid | None = None


def load_masks(options: CostmapFilterOptions) -> CostmapFilters:
    """Read the files that the options name. Raises ThumperError, with exit code 2, when one is wrong."""
    keepout, speed = (load_mask(Path(name)) if name else None for name in (options.keepout, options.speed))
    return CostmapFilters(keepout=keepout, speed=speed)


def load_mask(yaml_path: Path) -> OccupancyGrid:
    """Read a mask: cells from 0 to 100, -1 where it says nothing.

    Raises
    ------
    ThumperError
        A file is missing or broken; the message names the file, the key and the value.
    """
    told, dark = read_occupancy(yaml_path, MODES)
    if told.mode == "raw":
        pixels = np.rint(dark * 255.0 if told.negate else (1.0 - dark) * 255.0)
        cells = np.where(pixels <= OCCUPIED, pixels, UNKNOWN)
    else:
        part = (dark - told.free_thresh) / (told.occupied_thresh - told.free_thresh)
        between = np.rint(OCCUPIED * part) if told.mode == "scale" else np.float64(UNKNOWN)
        cells = np.where(
            dark > told.occupied_thresh, OCCUPIED, np.where(dark < told.free_thresh, FREE, between)
        )
    return OccupancyGrid(
        cells=cells.astype(np.int8),
        resolution_m=told.resolution_m,
        origin_x_m=told.origin_x_m,
        origin_y_m=told.origin_y_m,
    )


def is_closed(keepout: OccupancyGrid | None, grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Which cells of a grid have their centre on closed ground, shape (rows, cols)."""
    closed = np.zeros(grid.cells.shape, np.bool_)
    if keepout is None:
        return closed
    rows, cols = grid.cells.shape
    row = _index(grid.origin_y_m, grid.resolution_m, rows, keepout.origin_y_m, keepout.resolution_m)
    col = _index(grid.origin_x_m, grid.resolution_m, cols, keepout.origin_x_m, keepout.resolution_m)
    row_in = (row >= 0) & (row < keepout.cells.shape[0])
    col_in = (col >= 0) & (col < keepout.cells.shape[1])
    chosen = keepout.cells[np.ix_(row[row_in], col[col_in])] >= KEEP_OUT_PERCENT
    closed[np.ix_(row_in, col_in)] = chosen
    return closed


def _index(
    origin_m: float, cell_m: float, count: int, mask_origin_m: float, mask_m: float
) -> NDArray[np.int64]:
    centres_m = origin_m + (np.arange(count) + 0.5) * cell_m
    index: NDArray[np.int64] = np.floor((centres_m - mask_origin_m) / mask_m + 1e-9).astype(np.int64)
    return index


def speed_parts(speed: OccupancyGrid, points_m: FloatArray) -> FloatArray:
    """Part of the fastest speed that the mask leaves at points, shape (n, 2) [m]; 0 to 1, shape (n,)."""
    cells = np.floor((points_m - (speed.origin_x_m, speed.origin_y_m)) / speed.resolution_m).astype(np.int64)
    inside = (cells >= 0).all(axis=1) & (cells < speed.cells.shape[::-1]).all(axis=1)
    parts = np.ones(len(points_m))
    told = speed.cells[cells[inside, 1], cells[inside, 0]]
    parts[inside] = np.where(told == UNKNOWN, 1.0, 1.0 - told / OCCUPIED)
    return parts
