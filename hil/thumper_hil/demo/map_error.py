"""Evaluate a map against ground truth that the robot never sees. Pure functions."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from thumper.common.geometry import FloatArray
from thumper.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from thumper_hil.world.world import World

OCCUPIED_PERCENT = 65
TRUTH_RESOLUTION_M = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class MapQuality:
    """Errors of a map against the true world."""

    wall_error_mean_m: float  # distance from the centres of occupied cells to the nearest solid object
    wall_error_p95_m: float
    occupied_within_one_cell: float  # share of the occupied cells with an error of at most one cell
    free_but_solid: float  # share of the free cells whose centre is inside a solid object
    known_area_m2: float


def compare_map(grid: OccupancyGrid, world: World) -> MapQuality:
    """Compare `grid`, which is in the world's frame, with the world."""
    truth = world.to_grid(TRUTH_RESOLUTION_M)
    distance_m = distance_transform_edt(truth.cells != OCCUPIED) * TRUTH_RESOLUTION_M
    occupied = _sample(distance_m, truth, grid, grid.cells >= OCCUPIED_PERCENT)
    free = _sample(distance_m, truth, grid, grid.cells == FREE)
    return MapQuality(
        wall_error_mean_m=float(occupied.mean()),
        wall_error_p95_m=float(np.percentile(occupied, 95)),
        occupied_within_one_cell=float((occupied <= grid.resolution_m).mean()),
        free_but_solid=float((free == 0.0).mean()),
        known_area_m2=float((grid.cells >= 0).sum() * grid.resolution_m**2),
    )


def _sample(
    distance_m: FloatArray, truth: OccupancyGrid, grid: OccupancyGrid, chosen: np.ndarray
) -> FloatArray:
    """Return the distances at the centres of the chosen cells; outside the truth, those at its border."""
    rows, columns = np.nonzero(chosen)
    x_m = grid.origin_x_m + (columns + 0.5) * grid.resolution_m
    y_m = grid.origin_y_m + (rows + 0.5) * grid.resolution_m
    truth_columns = np.clip(
        ((x_m - truth.origin_x_m) / truth.resolution_m).astype(int), 0, truth.cells.shape[1] - 1
    )
    truth_rows = np.clip(
        ((y_m - truth.origin_y_m) / truth.resolution_m).astype(int), 0, truth.cells.shape[0] - 1
    )
    return np.asarray(distance_m[truth_rows, truth_columns], dtype=np.float64)
