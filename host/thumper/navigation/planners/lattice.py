"""The lattice planner: a way that the whole robot can drive, turns included, with clearance."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import Ground
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarOptions, AStarPlanner
from thumper.navigation.planners.dijkstra import dijkstra
from thumper.navigation.planners.lattice_search import search_poses
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import polyline_cost, resample, smooth
from thumper.navigation.planners.start_and_goal_cells import locate
from thumper.navigation.planners.traversal_cost import price_cells

MARGIN = 120.0  # how far round the cheapest way the potential is known [free cells]: room for detours


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticeOptions:
    """What makes a way good to drive."""

    # Extra price of the dearest inflated cell, in free cells; more keeps further from obstacles.
    obstacle_weight: Annotated[float, Ge(0)] = 6.0
    # Whether the path may cross cells never seen; a robot that maps as it goes needs it.
    allow_unknown: bool = True
    # Extra price of an unknown cell, in free cells; more prefers seen ground.
    unknown_weight: Annotated[float, Ge(0)] = 1.0
    # How far the search may begin from a robot that stands too near an obstacle [m].
    escape_radius_m: Annotated[float, Gt(0)] = 0.30
    # Price of a turn [m/rad]: free way for each radian; more prefers wide bends and straight ways.
    turn_m_per_rad: Annotated[float, Ge(0)] = 0.10
    # How many times dearer backward is than forward; the robot is blind there.
    back_weight: Annotated[float, Ge(1)] = 5.0
    # Weight of what is left to go; 1 finds the best way, more finds one sooner.
    greed: Annotated[float, Ge(1)] = 1.2
    # Most poses looked at; when they are used up the way is planned by A* with the inscribed circle alone.
    most_poses: Annotated[int, Gt(0)] = 200_000
    # Rounds of corner rounding.
    smoothing_rounds: Annotated[int, Ge(0)] = 6


class LatticePlanner:
    """`Planner` over place and heading."""

    def __init__(self, options: LatticeOptions, footprint: Footprint) -> None:
        self._options = options
        self._footprint = footprint
        self._circle = AStarPlanner(
            AStarOptions(
                obstacle_weight=options.obstacle_weight,
                allow_unknown=options.allow_unknown,
                unknown_weight=options.unknown_weight,
                escape_radius_m=options.escape_radius_m,
            )
        )

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Return a way that the outline can drive, shape (n, 2), about one cell between points.

        Where none is found, the way of the inscribed circle is returned and the reason says so: the map may
        look tighter than the place is.
        """
        prices = self._prices(costmap)
        ends = locate(costmap, prices, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        poses = self.poses(costmap, map_from_base, goal)
        if len(poses) == 0:
            fallback = self._circle.plan(costmap, map_from_base, goal)
            told = f"no drivable way to the goal {goal} is known yet: following the shortest one"
            return dataclasses.replace(fallback, reason=fallback.reason or told)
        poses[:, :2] = (poses[:, :2] - costmap.origin_m) / costmap.resolution_m
        points = np.vstack((poses[:, :2], ends.goal_cells))
        moved = np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-6)
        path = resample(points[moved], 1.0) if moved.sum() > 1 else np.repeat(points[:1], 2, axis=0)
        smooth(prices, path, self._options.smoothing_rounds)
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m)

    def poses(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> FloatArray:
        """Poses (x, y, theta) of the way, shape (n, 3) [m, rad], or none, shape (0, 3)."""
        prices = self._prices(costmap)
        ends = locate(costmap, prices, map_from_base, goal, self._options.escape_radius_m)
        if isinstance(ends, str) or not np.isfinite(prices.flat[ends.goal]):
            return np.empty((0, 3))
        potential = dijkstra(prices, ends.goal, ends.start, False, MARGIN)
        if not np.isfinite(potential[ends.start]):
            return np.empty((0, 3))
        start = np.append(ends.start_cells, map_from_base.theta_rad)
        poses = self._search(costmap, prices, potential, start, goal)
        poses[:, :2] = poses[:, :2] * costmap.resolution_m + costmap.origin_m
        return poses

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Cost of a path on this costmap [m of free way]; inf when it enters what the options forbid."""
        cells = np.ascontiguousarray((path_m - costmap.origin_m) / costmap.resolution_m)
        return costmap.resolution_m * polyline_cost(self._prices(costmap), cells)

    def _prices(self, costmap: Costmap) -> np.typing.NDArray[np.float32]:
        options = self._options
        unknown = options.unknown_weight if options.allow_unknown else None
        return price_cells(costmap, options.obstacle_weight, unknown)

    def _search(
        self,
        costmap: Costmap,
        prices: np.typing.NDArray[np.float32],
        potential: np.typing.NDArray[np.float32],
        start: FloatArray,
        goal: Goal,
    ) -> FloatArray:
        options, cell_m = self._options, costmap.resolution_m
        goal_cells = (np.array((goal.x_m, goal.y_m)) - costmap.origin_m) / cell_m
        ground = Ground.of(costmap, self._footprint)
        return search_poses(
            prices,
            potential,
            ground._replace(origin=np.zeros(2), resolution=1.0, outline=ground.outline / cell_m),
            start,
            goal_cells,
            max(2.0, goal.tolerance_m / cell_m),
            options.turn_m_per_rad / cell_m,
            options.back_weight,
            options.greed,
            options.escape_radius_m / cell_m,
            options.most_poses,
        )
