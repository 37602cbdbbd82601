"""The five cost classes of costmap_2d against their definition."""

import math

import numpy as np

from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.footprint_collision import (
    CollisionGrid,
    GroundCost,
    ground_cost_at,
    lethal_count,
    safe_squared_cells,
)
from thumper.navigation.footprint import Footprint

CELL_M = 0.05


def test_cost_class_by_distance() -> None:
    """One obstacle in the middle, unknown space on the right; centre distances of whole cells."""
    cells = np.zeros((41, 41), np.int8)
    cells[20, 20], cells[:, 34:] = 100, -1
    grid = OccupancyGrid(cells=cells, resolution_m=CELL_M, origin_x_m=0.0, origin_y_m=0.0)
    costmap, footprint = build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions()), Footprint()
    along = [ground_cost_at(costmap, footprint, 1.025 + CELL_M * cell, 1.025) for cell in range(21)]
    # Inscribed up to 0.15 m, 3 cells; circumscribed up to 0.258 m plus the diagonals, 6 cells.
    assert along[:4] == [GroundCost.LETHAL] + [GroundCost.INSCRIBED] * 3
    assert along[4:7] == [GroundCost.POSSIBLY_CIRCUMSCRIBED] * 3
    assert along[7:14] == [GroundCost.FREE] * 7
    assert along[14:] == [GroundCost.UNKNOWN] * 7
    assert ground_cost_at(costmap, footprint, -0.1, 1.0) is None


def test_free_means_free_at_every_heading() -> None:
    """The outline at 24 headings in random worlds."""
    rng, footprint = np.random.default_rng(0), Footprint()
    outline_m = footprint.outline_m(0.25 * CELL_M)
    for _ in range(20):
        cells = np.where(rng.random((40, 40)) < 0.02, 100, 0).astype(np.int8)
        grid = OccupancyGrid(cells=cells, resolution_m=CELL_M, origin_x_m=0.0, origin_y_m=0.0)
        costmap = build_costmap(grid, np.empty((0, 2)), footprint, CostmapOptions())
        safe = safe_squared_cells(footprint.circumscribed_radius_m, CELL_M)
        everywhere = CollisionGrid.from_costmap(costmap, footprint)
        everywhere = everywhere._replace(outline=outline_m, safe_squared=math.inf)
        for row, col in rng.integers(6, 34, (20, 2)):
            x_m, y_m = grid.centre_of(int(row), int(col))
            touching = [lethal_count(everywhere, False, x_m, y_m, turn * math.tau / 24) for turn in range(24)]
            if ground_cost_at(costmap, footprint, x_m, y_m) is GroundCost.FREE:
                assert max(touching) == 0
                assert costmap.squared_cells[row, col] > safe
