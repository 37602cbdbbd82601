"""The five kinds of ground of a costmap, as ROS's costmap_2d tells them apart (http://wiki.ros.org/costmap_2d)."""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from thumper.navigation.costmap import Costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.footprint_check import safe_squared_cells
from thumper.navigation.inflation import INSCRIBED, LETHAL, UNKNOWN


class Category(Enum):
    """What a cell means for a robot whose centre is in it."""

    FREE = "free"  # the outline touches nothing, whichever way the robot looks
    POSSIBLY_CIRCUMSCRIBED = "possibly circumscribed"  # whether it does depends on the heading
    INSCRIBED = "inscribed"  # it certainly touches
    LETHAL = "lethal"  # an obstacle
    UNKNOWN = "unknown"  # never seen


ORDER = tuple(Category)


def categories(costmap: Costmap, footprint: Footprint) -> NDArray[np.uint8]:
    """Index into `ORDER` of each cell, shape (rows, cols).

    The border of "possibly circumscribed" is the distance from which `lethal_count` walks the outline.
    """
    safe = safe_squared_cells(footprint.circumscribed_radius_m, costmap.resolution_m)
    found = np.where(costmap.squared_cells <= safe, _index(Category.POSSIBLY_CIRCUMSCRIBED), 0)
    for cost, category in (
        (UNKNOWN, Category.UNKNOWN),
        (INSCRIBED, Category.INSCRIBED),
        (LETHAL, Category.LETHAL),
    ):
        found[costmap.costs == cost] = _index(category)
    return found.astype(np.uint8)


def category_at(costmap: Costmap, footprint: Footprint, x_m: float, y_m: float) -> Category | None:
    """The category of a place; None off the map."""
    rows, cols = costmap.cells_of(np.array(((x_m, y_m),)))
    row, col = int(rows[0]), int(cols[0])
    if not (0 <= row < costmap.costs.shape[0] and 0 <= col < costmap.costs.shape[1]):
        return None
    return ORDER[int(categories(costmap, footprint)[row, col])]


def _index(category: Category) -> int:
    return ORDER.index(category)
