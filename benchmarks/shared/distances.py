"""Distances to occupied cells, computed in another way than the mappers do."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.scan_matching.distance_field import FieldArray, metric_distances


def squared_distances_of(occupied: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the squared distance of each cell to an occupied one, in cells; huge if there is none."""
    if not occupied.any():
        return np.full(occupied.shape, np.iinfo(np.int64).max)
    return np.asarray(np.rint(distance_transform_edt(~occupied) ** 2).astype(np.int64))


def distance_from_scratch(grid: HitGrid) -> FieldArray:
    """Return the distance field [m] by the counts alone; `distance_m` always equals it."""
    table_m = metric_distances(grid.max_distance_cells, grid.resolution_m)
    return table_m[np.minimum(squared_distances_of(grid.occupied()), len(table_m) - 1)]
