"""What every global planner offers: a costmap, a start and a goal in, a path or a reason out."""

from dataclasses import dataclass
from typing import Protocol

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.goal import Goal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanResult:
    """A path, or None and why not. `reason` beside a path says where it ends if not at the goal."""

    path_m: FloatArray | None = None  # shape (n >= 2, 2), in map, from the robot to the goal
    reason: str = ""
    closed: bool = False  # the search saw all that can be reached, and the goal is not of it


class Planner(Protocol):
    """Finds a way through the costmap."""

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return the cheapest path, or why there is none."""
        ...

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Cost of a path, shape (n, 2), on this costmap [m of free way]; inf when an obstacle is on it."""
        ...
