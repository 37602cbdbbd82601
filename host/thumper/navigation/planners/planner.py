"""The interface of the global planners: costmap, start and goal in, a path or a reason out."""

from dataclasses import dataclass
from typing import Protocol

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal
from thumper.navigation.planners.cell_costs import CellCosts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanResult:
    """A path, or None and the reason. A `reason` with a path says where the path ends if not at the goal."""

    path_m: FloatArray | None = None  # shape (n >= 2, 2), in map, from the robot to the goal
    reason: str = ""
    unreachable: bool = False  # the search covered all reachable space and did not find the goal


class Planner(Protocol):
    """Finds a path through the costmap."""

    def search(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> Search[PlanResult]:
        """Find the cheapest path in slices. The costmap may change between two slices."""
        ...

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the cheapest path, or the reason why there is none."""
        ...

    def cell_costs(self, costmap: Costmap) -> CellCosts:
        """Return the cost of each cell; inf where this planner does not drive."""
        ...

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Return the cost of a path, shape (n, 2) [m of free space]; inf if it crosses an obstacle."""
        ...
