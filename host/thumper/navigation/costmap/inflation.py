"""The costs computed from the distance to the nearest obstacle cell."""

import math

import numpy as np
from numpy.typing import NDArray

ByteArray = NDArray[np.uint8]
IntArray = NDArray[np.int32]

FREE, MOST_INFLATED, INSCRIBED, LETHAL, UNKNOWN = 0, 252, 253, 254, 255


def cost_table(
    *, radius_cells: int, resolution_m: float, inscribed_m: float, radius_m: float, decay_per_m: float
) -> ByteArray:
    """Return the cost of each squared distance 0 ... (radius_cells + 1)^2 [cells^2], shape (n,).

    254 at the obstacle, 253 up to the inscribed radius, then floor(252 exp(-decay (d - inscribed))) up to
    `radius_m` (the formula of ROS costmap_2d).
    """
    distances_m = np.sqrt(np.arange((radius_cells + 1) ** 2 + 1)) * resolution_m
    inflated = np.floor(MOST_INFLATED * np.exp(-decay_per_m * (distances_m - inscribed_m)))
    inside = distances_m <= inscribed_m + 1e-9
    costs = np.where(inside, INSCRIBED, np.where(distances_m <= radius_m + 1e-9, inflated, FREE))
    costs[0] = LETHAL
    costs[-1] = FREE
    return costs.astype(np.uint8)


def whole_cells(radius_m: float, resolution_m: float) -> int:
    """Return the number of whole cells in a radius, at least 1."""
    return max(1, math.floor(radius_m / resolution_m + 1e-9))
