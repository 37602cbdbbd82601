"""The five kinds of ground of a costmap, as ROS's costmap_2d tells them apart (http://wiki.ros.org/costmap_2d)."""

from enum import Enum

import numpy as np

from thumper.navigation.costmap import Costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.footprint_check import safe_squared_cells
from thumper.navigation.inflation import INSCRIBED, LETHAL, UNKNOWN


class Category(Enum):
    """What a place means for a robot whose centre is in it."""

    FREE = "free"  # the outline touches nothing, whichever way the robot looks
    POSSIBLY_CIRCUMSCRIBED = "possibly circumscribed"  # whether it does depends on the heading
    INSCRIBED = "inscribed"  # it certainly touches
    LETHAL = "lethal"  # an obstacle
    UNKNOWN = "unknown"  # never seen


OF_COST = {UNKNOWN: Category.UNKNOWN, INSCRIBED: Category.INSCRIBED, LETHAL: Category.LETHAL}


def category_at(costmap: Costmap, footprint: Footprint, x_m: float, y_m: float) -> Category | None:
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
    return Category.POSSIBLY_CIRCUMSCRIBED if squared <= safe else Category.FREE
