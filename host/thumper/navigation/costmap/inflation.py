"""Exact distance to the nearest obstacle cell up to a radius, and the costs computed from it.

Two separable passes as in Felzenszwalb & Huttenlocher, "Distance Transforms of Sampled Functions" (2012).
The radius is a dozen cells, so the second pass simply tries every offset: the inner loop is a minimum over a
row, which the compiler vectorises, and no lower envelope is needed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel

ByteArray = NDArray[np.uint8]
IntArray = NDArray[np.int32]

FREE, MOST_INFLATED, INSCRIBED, LETHAL, UNKNOWN = 0, 252, 253, 254, 255


@kernel
def squared_distances(lethal: NDArray[np.bool_], radius: int) -> IntArray:
    """Return the squared distance [cells^2] of each cell to the nearest lethal one, shape as given.

    Exact up to `radius` cells; everything further is (radius + 1)^2.
    """
    rows, cols = lethal.shape
    far = np.int32(radius + 1)
    far2 = np.int32(far * far)
    gap = np.empty((rows, cols), np.int32)
    for col in range(cols):
        gap[0, col] = 0 if lethal[0, col] else far
    for row in range(1, rows):
        for col in range(cols):
            gap[row, col] = 0 if lethal[row, col] else min(far, gap[row - 1, col] + 1)
    for row in range(rows - 2, -1, -1):
        for col in range(cols):
            gap[row, col] = min(gap[row, col], gap[row + 1, col] + 1)
    padded = np.full(cols + 2 * radius, far2, np.int32)
    for row in range(rows):
        nearest = gap[row]
        for col in range(cols):
            nearest[col] *= nearest[col]
            padded[radius + col] = nearest[col]
        for offset in range(1, radius + 1):
            left = padded[radius - offset : radius - offset + cols]
            right = padded[radius + offset : radius + offset + cols]
            offset2 = np.int32(offset * offset)
            for col in range(cols):
                nearest[col] = min(nearest[col], min(left[col], right[col]) + offset2)
    return gap


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
