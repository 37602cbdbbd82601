"""Where the robot's outline lies on the costmap. Kernels: arrays in, numbers out."""

import math

from thumper.geometry import FloatArray
from thumper.kernel import kernel
from thumper.navigation.inflation import LETHAL, UNKNOWN, ByteArray, IntArray

OFF_MAP = -1


@kernel
def lethal_count(
    costs: ByteArray,
    squared_cells: IntArray,
    origin_m: FloatArray,
    resolution_m: float,
    outline_m: FloatArray,
    safe_squared: float,
    unknown_blocks: bool,
    x_m: float,
    y_m: float,
    theta_rad: float,
) -> int:
    """Number of outline points, shape (n, 2), on obstacle cells (254, and 255 if `unknown_blocks`); -1 off
    the map.

    Only the outline is tested: whatever is inside it had to cross it, as long as a step is shorter than a
    cell. It is walked only where the centre cell is within `safe_squared` [cells^2] of an obstacle.
    """
    rows, cols = costs.shape
    col = math.floor((x_m - origin_m[0]) / resolution_m)
    row = math.floor((y_m - origin_m[1]) / resolution_m)
    if row < 0 or col < 0 or row >= rows or col >= cols:
        return OFF_MAP
    if not unknown_blocks and squared_cells[row, col] > safe_squared:
        return 0
    cos, sin = math.cos(theta_rad), math.sin(theta_rad)
    count = 0
    for i in range(outline_m.shape[0]):
        px = x_m + cos * outline_m[i, 0] - sin * outline_m[i, 1]
        py = y_m + sin * outline_m[i, 0] + cos * outline_m[i, 1]
        col = math.floor((px - origin_m[0]) / resolution_m)
        row = math.floor((py - origin_m[1]) / resolution_m)
        if row < 0 or col < 0 or row >= rows or col >= cols:
            return OFF_MAP
        cost = costs[row, col]
        if cost == LETHAL or (unknown_blocks and cost == UNKNOWN):
            count += 1
    return count


def safe_squared_cells(circumscribed_m: float, resolution_m: float) -> float:
    """Squared centre distance [cells^2] beyond which no outline point can lie on an obstacle cell.

    Both the centre and the outline point lie up to half a diagonal from the centres of their cells.
    """
    return (circumscribed_m / resolution_m + math.sqrt(2.0)) ** 2
