"""The costmap of the map alone, in bands of rows: a whole large map takes longer than a control cycle."""

from dataclasses import replace

import numpy as np

from thumper.common.resumable import Search, bands_of
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap, inflation_radius_cells
from thumper.navigation.costmap.filters import Masks
from thumper.navigation.footprint import Footprint

NO_HITS = np.empty((0, 2))


def build_band(
    grid: OccupancyGrid,
    rows: slice,
    footprint: Footprint,
    options: CostmapOptions,
    keepout: Masks = (),
) -> Costmap:
    """Return these rows of the costmap that `build_costmap` would build of the whole grid without hits."""
    around = inflation_radius_cells(footprint, options, grid.resolution_m)
    top = max(0, rows.start - around)
    band = replace(
        grid,
        cells=grid.cells[top : rows.stop + around],
        origin_y_m=grid.origin_y_m + top * grid.resolution_m,
    )
    costmap = build_costmap(band, NO_HITS, footprint, options, keepout)
    inner = slice(rows.start - top, rows.stop - top)
    return replace(costmap, costs=costmap.costs[inner], squared_cells=costmap.squared_cells[inner])


def search_costmap(grid: OccupancyGrid, footprint: Footprint, options: CostmapOptions) -> Search[Costmap]:
    """Return the costmap of a grid without hits, one band in each slice."""
    whole = Costmap(
        costs=np.empty(grid.cells.shape, np.uint8),
        squared_cells=np.empty(grid.cells.shape, np.int32),
        resolution_m=grid.resolution_m,
        origin_x_m=grid.origin_x_m,
        origin_y_m=grid.origin_y_m,
    )
    for rows in bands_of(grid.cells.shape):
        if rows.start > 0:
            yield
        band = build_band(grid, rows, footprint, options)
        whole.costs[rows], whole.squared_cells[rows] = band.costs, band.squared_cells
    return whole
