"""Where the robot's outline lies on the costmap. Kernels: arrays in, numbers out."""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import INSCRIBED, LETHAL, UNKNOWN, ByteArray, IntArray
from thumper.navigation.footprint import Footprint


class GroundCost(Enum):
    """What a place means for a robot whose centre is in it."""

    FREE = "free"  # the outline touches nothing, whichever way the robot looks
    POSSIBLY_CIRCUMSCRIBED = "possibly circumscribed"  # whether it does depends on the heading
    INSCRIBED = "inscribed"  # it certainly touches
    LETHAL = "lethal"  # an obstacle
    UNKNOWN = "unknown"  # never seen


OF_COST = {UNKNOWN: GroundCost.UNKNOWN, INSCRIBED: GroundCost.INSCRIBED, LETHAL: GroundCost.LETHAL}


def category_at(costmap: Costmap, footprint: Footprint, x_m: float, y_m: float) -> GroundCost | None:
    """The category of a place; None off the map.

    The border of "possibly circumscribed" is the distance from which `lethal_count` walks the outline.
    """
    (row,), (col,) = costmap.cells_of(np.array(((x_m, y_m),)))
    if not (0 <= row < costmap.costs.shape[0] and 0 <= col < costmap.costs.shape[1]):
        return None
    cost, squared = int(costmap.costs[row, col]), costmap.squared_cells[row, col]
    if cost in OF_COST:
        return OF_COST[cost]
    safe = safe_squared_cells(footprint.circumscribed_radius_m, costmap.resolution_m)
    return GroundCost.POSSIBLY_CIRCUMSCRIBED if squared <= safe else GroundCost.FREE


OFF_MAP = -1


class Ground(NamedTuple):
    """A costmap and the outline that is laid on it, as kernels take them.

    The outline, shape (n, 2), is in the unit of `resolution`; it is walked only where the centre cell is
    within `safe_squared` [cells^2] of an obstacle.
    """

    costs: ByteArray
    squared_cells: IntArray
    origin: FloatArray
    resolution: float
    outline: FloatArray
    safe_squared: float

    @classmethod
    def of(cls, costmap: Costmap, footprint: Footprint) -> "Ground":
        """Lay a footprint on a costmap; lengths in metres."""
        return cls(
            costs=costmap.costs,
            squared_cells=costmap.squared_cells,
            origin=costmap.origin_m,
            resolution=costmap.resolution_m,
            outline=footprint.outline_m(0.5 * costmap.resolution_m),
            safe_squared=safe_squared_cells(footprint.circumscribed_radius_m, costmap.resolution_m),
        )


@kernel
def lethal_count(ground: Ground, unknown_blocks: bool, x: float, y: float, theta_rad: float) -> int:
    """Number of outline points on obstacle cells (254, and 255 if `unknown_blocks`); -1 off the map.

    Only the outline is tested: whatever is inside it had to cross it, as long as a step is shorter than a
    cell.
    """
    costs, squared_cells, outline = ground.costs, ground.squared_cells, ground.outline
    origin_x, origin_y, resolution = ground.origin[0], ground.origin[1], ground.resolution
    rows, cols = costs.shape
    col = math.floor((x - origin_x) / resolution)
    row = math.floor((y - origin_y) / resolution)
    if row < 0 or col < 0 or row >= rows or col >= cols:
        return OFF_MAP
    if not unknown_blocks and squared_cells[row, col] > ground.safe_squared:
        return 0
    cos, sin = math.cos(theta_rad), math.sin(theta_rad)
    count = 0
    for i in range(outline.shape[0]):
        px = x + cos * outline[i, 0] - sin * outline[i, 1]
        py = y + sin * outline[i, 0] + cos * outline[i, 1]
        col = math.floor((px - origin_x) / resolution)
        row = math.floor((py - origin_y) / resolution)
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
