"""The smooth path down a potential. Kernels in cells."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.planners.cell_costs import CostArray
from thumper.navigation.planners.dijkstra import SOURCE, potential_at

# Least length of the mean of four unit vectors. Below it the gradients contradict each other (a saddle, a
# slit).
LEAST_GRADIENT = 0.2
DESCENT_CHECK_POINTS = 4  # the potential must fall within this many points


@kernel
def downhill(potential: CostArray, cols: int, cell: int) -> tuple[float, float]:
    """Return the downhill direction (x, y) at a cell's centre, of length 1 or 0.

    Uses those neighbours that have a potential.
    """
    here = potential_at(potential, cell)
    if not here < np.inf:
        return 0.0, 0.0
    right, left = potential_at(potential, cell + 1), potential_at(potential, cell - 1)
    up, down = potential_at(potential, cell + cols), potential_at(potential, cell - cols)
    dx = dy = 0.0
    if left < np.inf:
        dx += float(here - left)
    if right < np.inf:
        dx += float(right - here)
    if down < np.inf:
        dy += float(here - down)
    if up < np.inf:
        dy += float(up - here)
    size = math.hypot(dx, dy)
    return (-dx / size, -dy / size) if size > 0.0 else (0.0, 0.0)


@kernel
def interpolated_downhill(potential: CostArray, cols: int, x: float, y: float) -> tuple[float, float]:
    """Return the sum of the downhill directions at the four centres round a point, weighted by nearness."""
    left, below = math.floor(x - 0.5), math.floor(y - 0.5)
    fx, fy = x - 0.5 - left, y - 0.5 - below
    dx = dy = 0.0
    for k in range(4):
        ux, uy = downhill(potential, cols, (below + (k >> 1)) * cols + left + (k & 1))
        weight = (fx if k & 1 else 1.0 - fx) * (fy if k >> 1 else 1.0 - fy)
        dx += weight * ux
        dy += weight * uy
    return dx, dy


@kernel
def lowest_neighbour(potential: CostArray, cols: int, cell: int) -> int:
    """Return the lowest of the eight neighbours not cut off by a corner; the cell itself if none is lower."""
    best = cell
    for d_row in range(-1, 2):
        for d_col in range(-1, 2):
            neighbour = cell + d_row * cols + d_col
            if not potential_at(potential, neighbour) < potential_at(potential, best):
                continue
            if potential[cell + d_row * cols] > 0.0 and potential[cell + d_col] > 0.0:
                best = neighbour
    return best


@kernel
def gradient_path(potential: CostArray, cols: int, start_x: float, start_y: float, step: float) -> FloatArray:
    """Return points, shape (n, 2) [cells], downhill from a start to the source's cell, about `step` apart.

    Follows the interpolated gradient. Where that leaves the potential or does not descend, the path goes to
    the centre of the lowest neighbour instead, so that it always ends at the source. Empty if the start has
    no potential. Only the number of cells limits its length, not the map's width.
    """
    points = np.empty((1024, 2))
    x, y = start_x, start_y
    count = 0
    before = np.inf
    while count < 2 * potential.size:
        cell = math.floor(y) * cols + math.floor(x)
        if potential[cell] == 0.0:
            return np.empty((0, 2))
        if count == points.shape[0]:
            points = np.concatenate((points, np.empty((count, 2))))
        points[count, 0], points[count, 1] = x, y
        count += 1
        if potential[cell] == SOURCE:
            return points[:count].copy()
        falls = True
        if count % DESCENT_CHECK_POINTS == 0:
            falls = potential[cell] < before
            before = min(before, potential[cell])
        low = lowest_neighbour(potential, cols, cell)
        if falls and potential[low] > SOURCE:
            dx, dy = interpolated_downhill(potential, cols, x, y)
            size = math.hypot(dx, dy)
            if size > LEAST_GRADIENT:
                nx, ny = x + step * dx / size, y + step * dy / size
                if potential[math.floor(ny) * cols + math.floor(nx)] > 0.0:
                    x, y = nx, ny
                    continue
        x, y = low % cols + 0.5, low // cols + 0.5
        if low == cell:
            return np.empty((0, 2))
    return np.empty((0, 2))
