"""Turn the zones of a map into the masks of the costmap filters."""

from collections.abc import Iterable

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.maps.annotations import Zone, ZoneKind
from thumper.maps.occupancy_grid import OCCUPIED, UNKNOWN, CellArray, OccupancyGrid
from thumper.navigation.costmap.filters import CostmapFilters

MASK_RESOLUTION_M = 0.05


def zone_masks(zones: Iterable[Zone]) -> CostmapFilters:
    """Return a keep-out or speed mask for each zone; without effect outside of it."""
    keepout, speed = [], []
    for zone in zones:
        if zone.kind is ZoneKind.KEEPOUT:
            keepout.append(polygon_mask(zone.polygon_m(), OCCUPIED))
        else:
            speed.append(polygon_mask(zone.polygon_m(), OCCUPIED - zone.speed_percent))
    return CostmapFilters(keepout=tuple(keepout), speed=tuple(speed))


def polygon_mask(polygon_m: FloatArray, value: int) -> OccupancyGrid:
    """Return a grid with `value` in the cells that a polygon, shape (k, 2) [m], covers; others are unknown.

    A cell is covered if its centre is inside by the even-odd rule, or if the outline touches it: a narrow
    zone has no gaps.
    """
    size_m = MASK_RESOLUTION_M
    first = np.floor(polygon_m.min(axis=0) / size_m)
    scaled = polygon_m / size_m - first  # in cells
    cols, rows = np.floor(scaled.max(axis=0)).astype(np.int64) + 1
    cells: CellArray = np.full((rows, cols), UNKNOWN, np.int8)
    starts, ends = scaled, np.roll(scaled, -1, axis=0)
    for row in range(rows):
        crossings = np.sort(_crossings(starts, ends, row + 0.5))
        for left, right in zip(crossings[::2], crossings[1::2], strict=True):
            cells[row, round(left) : round(right)] = value  # the centres between them
    for start, end in zip(starts, ends, strict=True):
        count = int(np.ceil(2.0 * np.abs(end - start).max())) + 1
        col, row = np.floor(np.linspace(start, end, count)).astype(np.int64).T
        cells[np.clip(row, 0, rows - 1), np.clip(col, 0, cols - 1)] = value  # against rounding
    return OccupancyGrid(
        cells=cells,
        resolution_m=size_m,
        origin_x_m=float(first[0] * size_m),
        origin_y_m=float(first[1] * size_m),
    )


def _crossings(starts: FloatArray, ends: FloatArray, y: float) -> FloatArray:
    """Return the x at which the edges cross a horizontal line; an even number."""
    crosses = (starts[:, 1] <= y) != (ends[:, 1] <= y)
    start, end = starts[crosses], ends[crosses]
    share = (y - start[:, 1]) / (end[:, 1] - start[:, 1])
    crossings: FloatArray = start[:, 0] + share * (end[:, 0] - start[:, 0])
    return crossings
