"""Exact distance to the nearest obstacle cell up to a radius.

Two separable passes as in Felzenszwalb & Huttenlocher, "Distance Transforms of Sampled Functions" (2012).
The radius is a dozen cells, so the second pass simply tries every offset: the inner loop is a minimum over a
row, which the compiler vectorises, and no lower envelope is needed.
"""

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel

IntArray = NDArray[np.int32]


@kernel
def squared_distances(lethal: NDArray[np.bool_], radius: int) -> IntArray:
    """Return the squared distance [cells^2] of each cell to the nearest lethal one, shape as given.

    Exact up to `radius` cells; everything further is (radius + 1)^2. Numba adds in 64 bits, and AVX2 has no
    minimum of those: the sums are cut to 32 bits.
    """
    rows, cols = lethal.shape
    far = np.int32(radius + 1)
    far2 = np.int32(far * far)
    gap = np.empty((rows, cols), np.int32)
    for col in range(cols):
        gap[0, col] = 0 if lethal[0, col] else far
    for row in range(1, rows):
        for col in range(cols):
            gap[row, col] = 0 if lethal[row, col] else min(far, np.int32(gap[row - 1, col] + 1))
    for row in range(rows - 2, -1, -1):
        for col in range(cols):
            gap[row, col] = min(gap[row, col], np.int32(gap[row + 1, col] + 1))
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
                nearest[col] = min(nearest[col], np.int32(min(left[col], right[col]) + offset2))
    return gap
