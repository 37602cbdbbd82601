"""navfn: a Dijkstra wave with interpolated potential and the gradient path down it.

Brock & Khatib, "High-speed navigation using the global dynamic window approach" (1999), with the prices of
ROS's navfn: 50 for a free cell and 0.8 for each unit of cost.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.dijkstra import dijkstra
from thumper.navigation.planners.gradient_path import gradient_path
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import polyline_cost
from thumper.navigation.planners.start_and_goal_cells import locate, substitute
from thumper.navigation.planners.traversal_cost import price_cells

STEP_CELLS = 0.5
EVERYWHERE = -1
MARGIN = 6.0  # how far beyond the goal's potential the wave goes on: the way down looks at neighbours


@dataclass(frozen=True, slots=True, kw_only=True)
class NavfnOptions:
    """What the wave finds dear."""

    # Extra price of the dearest inflated cell, in free cells; 4.032 is 0.8 * 252 / 50, as ROS has it.
    obstacle_weight: Annotated[float, Ge(0)] = 4.032
    # Whether the path may cross cells never seen.
    allow_unknown: bool = True
    # Extra price of an unknown cell, in free cells.
    unknown_weight: Annotated[float, Ge(0)] = 1.0
    # How far the search may begin from a robot that stands too near an obstacle [m].
    escape_radius_m: Annotated[float, Gt(0)] = 0.30
    # Whether the wave looks toward the goal first: the same path, found sooner.
    guided: bool = True


class NavfnPlanner:
    """`Planner` by wavefront."""

    def __init__(self, options: NavfnOptions) -> None:
        self._options = options

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the cheapest path, shape (n, 2), half a cell between points, or why there is none.

        A goal that cannot be entered is replaced by the nearest reachable place within its tolerance.
        """
        prices = self._prices(costmap)
        ends = locate(costmap, prices, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        cols = prices.shape[1]
        point, told = ends.goal_cells, ""
        open_ = bool(np.isfinite(prices.flat[ends.goal]))
        potential = dijkstra(
            prices, ends.start, ends.goal if open_ else EVERYWHERE, self._options.guided, MARGIN
        )
        if not np.isfinite(potential[ends.goal]):
            found = substitute(costmap, prices, potential, ends, goal)
            if isinstance(found, str):
                return PlanResult(reason=found, closed=True)
            _, point, told = found
        down = gradient_path(potential, cols, float(point[0]), float(point[1]), STEP_CELLS)
        if len(down) == 0:
            return PlanResult(reason=f"no way to the goal {goal}: the wave never came there")
        path = down[::-1]
        if not ends.start_moved and len(path) > 1:
            path = path[1:]  # the robot stands in this point's cell
        path = np.vstack((ends.start_cells, path))
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m, reason=told)

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Cost of a path on this costmap [m of free way]; inf when it enters what the options forbid."""
        cells = np.ascontiguousarray((path_m - costmap.origin_m) / costmap.resolution_m)
        return costmap.resolution_m * polyline_cost(self._prices(costmap), cells)

    def _prices(self, costmap: Costmap) -> np.typing.NDArray[np.float32]:
        options = self._options
        unknown = options.unknown_weight if options.allow_unknown else None
        return price_cells(costmap, options.obstacle_weight, unknown)
