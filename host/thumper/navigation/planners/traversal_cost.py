"""What a planner pays for each cell of a costmap."""

import numpy as np

from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.inflation import MOST_INFLATED, UNKNOWN
from thumper.navigation.planners.astar_search import CostArray


def price_cells(costmap: Costmap, obstacle_weight: float, unknown_weight: float | None) -> CostArray:
    """Price of each cell, shape (rows, cols): 1 free, rising with the cost, inf within the inscribed radius.

    Unknown cells cost 1 + `unknown_weight`, or are closed with None. The border row and column are inf, as
    the searches ask.
    """
    table = np.full(256, np.inf, np.float32)
    table[: MOST_INFLATED + 1] = 1.0 + obstacle_weight * np.arange(MOST_INFLATED + 1) / MOST_INFLATED
    if unknown_weight is not None:
        table[UNKNOWN] = 1.0 + unknown_weight
    prices: CostArray = table[costmap.costs]
    prices[0] = prices[-1] = np.inf
    prices[:, 0] = prices[:, -1] = np.inf
    return prices
