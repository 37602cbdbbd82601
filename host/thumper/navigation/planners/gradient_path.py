"""The smooth way down a potential. Kernels in cells."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.planners.astar_search import CostArray

LEAST_SLOPE = (
    0.2  # of the mean of four unit vectors: below, the slopes contradict each other (a saddle, a slit)
)
FALL_EVERY = 4  # points within which the potential must have fallen


@kernel
def slope(potential: CostArray, cols: int, cell: int) -> tuple[float, float]:
    """Downhill direction (x, y) at a cell's centre, of length 1 or 0, from whichever neighbours have a
    value.
    """
    here = potential[cell]
    if not here < np.inf:
        return 0.0, 0.0
    right, left = potential[cell + 1], potential[cell - 1]
    up, down = potential[cell + cols], potential[cell - cols]
    dx = dy = 0.0
    if left < np.inf:
        dx += here - left
    if right < np.inf:
        dx += right - here
    if down < np.inf:
        dy += here - down
    if up < np.inf:
        dy += up - here
    size = math.hypot(dx, dy)
    return (-dx / size, -dy / size) if size > 0.0 else (0.0, 0.0)


@kernel
def lowest_neighbour(potential: CostArray, cols: int, cell: int) -> int:
    """The lowest of the eight neighbours that no corner hides; the cell itself when none is lower."""
    best = cell
    for d_row in range(-1, 2):
        for d_col in range(-1, 2):
            neighbour = cell + d_row * cols + d_col
            if not potential[neighbour] < potential[best]:
                continue
            if potential[cell + d_row * cols] < np.inf and potential[cell + d_col] < np.inf:
                best = neighbour
    return best


@kernel
def gradient_path(potential: CostArray, cols: int, start_x: float, start_y: float, step: float) -> FloatArray:
    """Points, shape (n, 2) [cells], downhill from a start to the source's cell, about `step` apart.

    Follows the interpolated slope; wherever that leads off the potential or does not fall, the way goes to
    the lowest neighbour's centre instead, so that it always ends at the source. Empty when the start has no
    potential. Its length is limited by the number of cells alone, not by the map's width.
    """
    points = np.empty((1024, 2))
    x, y = start_x, start_y
    count = 0
    before = np.inf
    while count < 2 * potential.size:
        cell = math.floor(y) * cols + math.floor(x)
        if not potential[cell] < np.inf:
            return np.empty((0, 2))
        if count == points.shape[0]:
            points = np.concatenate((points, np.empty((count, 2))))
        points[count, 0], points[count, 1] = x, y
        count += 1
        if potential[cell] == 0.0:
            return points[:count].copy()
        falls = True
        if count % FALL_EVERY == 0:
            falls = potential[cell] < before
            before = min(before, potential[cell])
        low = lowest_neighbour(potential, cols, cell)
        if falls and potential[low] > 0.0:
            # Slope at the four centres round the point, weighted by nearness.
            left, below = math.floor(x - 0.5), math.floor(y - 0.5)
            fx, fy = x - 0.5 - left, y - 0.5 - below
            dx = dy = 0.0
            for k in range(4):
                ux, uy = slope(potential, cols, (below + (k >> 1)) * cols + left + (k & 1))
                weight = (fx if k & 1 else 1.0 - fx) * (fy if k >> 1 else 1.0 - fy)
                dx += weight * ux
                dy += weight * uy
            size = math.hypot(dx, dy)
            if size > LEAST_SLOPE:
                nx, ny = x + step * dx / size, y + step * dy / size
                if potential[math.floor(ny) * cols + math.floor(nx)] < np.inf:
                    x, y = nx, ny
                    continue
        x, y = low % cols + 0.5, low // cols + 0.5
        if low == cell:
            return np.empty((0, 2))
    return np.empty((0, 2))
