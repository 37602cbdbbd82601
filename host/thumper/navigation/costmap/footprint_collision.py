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

OFF_MAP = -1


class GroundCost(Enum):
    """The cost class of a place (costmap_2d), for a robot whose centre is there."""

    FREE = "free"  # the outline touches nothing, at any heading
    POSSIBLY_CIRCUMSCRIBED = "possibly circumscribed"  # the heading decides
    INSCRIBED = "inscribed"  # the outline certainly touches an obstacle
    LETHAL = "lethal"  # an obstacle
    UNKNOWN = "unknown"  # never observed


CLASS_OF_COST = {UNKNOWN: GroundCost.UNKNOWN, INSCRIBED: GroundCost.INSCRIBED, LETHAL: GroundCost.LETHAL}


def ground_cost_at(costmap: Costmap, footprint: Footprint, x_m: float, y_m: float) -> GroundCost | None:
    """Return the cost class of a place; None off the map.

    "Possibly circumscribed" ends at the distance beyond which `lethal_count` skips the outline.
    """
    (row,), (col,) = costmap.cells_of(np.array(((x_m, y_m),)))
    if not (0 <= row < costmap.costs.shape[0] and 0 <= col < costmap.costs.shape[1]):
        return None
    cost, squared = int(costmap.costs[row, col]), costmap.squared_cells[row, col]
    if cost in CLASS_OF_COST:
        return CLASS_OF_COST[cost]
    safe = safe_squared_cells(footprint.circumscribed_radius_m, costmap.resolution_m)
    return GroundCost.POSSIBLY_CIRCUMSCRIBED if squared <= safe else GroundCost.FREE


class CollisionGrid(NamedTuple):
    """A costmap and a footprint outline, as the collision kernels take them.

    The outline, shape (n, 2), is in the unit of `resolution`. It is checked only where the centre cell is
    within `safe_squared` [cells^2] of an obstacle.
    """

    costs: ByteArray
    squared_cells: IntArray
    origin: FloatArray
    resolution: float
    outline: FloatArray
    safe_squared: float

    @classmethod
    def from_costmap(cls, costmap: Costmap, footprint: Footprint) -> "CollisionGrid":
        """Combine a costmap and a footprint; lengths in metres."""
        return cls(
            costs=costmap.costs,
            squared_cells=costmap.squared_cells,
            origin=costmap.origin_m,
            resolution=costmap.resolution_m,
            outline=footprint.outline_m(0.5 * costmap.resolution_m),
            safe_squared=safe_squared_cells(footprint.circumscribed_radius_m, costmap.resolution_m),
        )


@kernel
def lethal_count(grid: CollisionGrid, unknown_blocks: bool, x: float, y: float, theta_rad: float) -> int:
    """Count the outline points on obstacle cells (254, and 255 if `unknown_blocks`); -1 off the map.

    Checking the outline is enough: an obstacle can only get inside by crossing it, as long as a step is
    shorter than a cell.
    """
    costs, squared_cells, outline = grid.costs, grid.squared_cells, grid.outline
    origin_x, origin_y, resolution = grid.origin[0], grid.origin[1], grid.resolution
    rows, cols = costs.shape
    col = math.floor((x - origin_x) / resolution)
    row = math.floor((y - origin_y) / resolution)
    if row < 0 or col < 0 or row >= rows or col >= cols:
        return OFF_MAP
    if not unknown_blocks and squared_cells[row, col] > grid.safe_squared:
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


@kernel
def touches_more(
    grid: CollisionGrid, unknown_blocks: bool, x: float, y: float, theta_rad: float, count: int
) -> bool:
    """Return whether `lethal_count` is more than `count`, or the robot is off the map."""
    costs, outline, resolution = grid.costs, grid.outline, grid.resolution
    origin_x, origin_y = grid.origin[0], grid.origin[1]
    rows, cols = costs.shape
    col = math.floor((x - origin_x) / resolution)
    row = math.floor((y - origin_y) / resolution)
    if row < 0 or col < 0 or row >= rows or col >= cols:
        return True
    if not unknown_blocks and grid.squared_cells[row, col] > grid.safe_squared:
        return False
    cos, sin = math.cos(theta_rad), math.sin(theta_rad)
    for i in range(outline.shape[0]):
        px = x + cos * outline[i, 0] - sin * outline[i, 1]
        py = y + sin * outline[i, 0] + cos * outline[i, 1]
        col = math.floor((px - origin_x) / resolution)
        row = math.floor((py - origin_y) / resolution)
        if row < 0 or col < 0 or row >= rows or col >= cols:
            return True
        cost = costs[row, col]
        if cost == LETHAL or (unknown_blocks and cost == UNKNOWN):
            count -= 1
            if count < 0:
                return True
    return False


@kernel
def is_free(grid: CollisionGrid, x: float, y: float, theta_rad: float) -> bool:
    """Return whether `lethal_count` is 0 where unknown ground does not block."""
    return not touches_more(grid, False, x, y, theta_rad, 0)


def safe_squared_cells(circumscribed_m: float, resolution_m: float) -> float:
    """Return the squared distance [cells^2] beyond which no outline point is on an obstacle cell.

    The robot's centre and the outline point are each up to half a diagonal from the centres of their cells.
    """
    return (circumscribed_m / resolution_m + math.sqrt(2.0)) ** 2
