"""The lattice planner: a path with clearance that the whole robot can drive, rotations included."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, run_to_end
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import CollisionGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.cell_costs import CellCosts, cost_at
from thumper.navigation.planners.dijkstra import search_dijkstra
from thumper.navigation.planners.lattice_search import LatticeProblem, LatticeWeights, search_lattice
from thumper.navigation.planners.planner import PlanResult
from thumper.navigation.planners.polyline import resample, smooth
from thumper.navigation.planners.start_and_goal_cells import find_ends
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, path_cost_m, traversal_cost

# How far round the cheapest path for a point the heuristic is known [free cells]: first near it, and only if
# the whole robot cannot drive there, further away.
NEAR_MARGIN, FAR_MARGIN = 30.0, 120.0
HEURISTIC_WEIGHT = 1.2  # finds a path sooner that costs at most 20 % more
MAX_NODES = 200_000  # then A* plans with the inscribed circle alone
SMOOTHING_ROUNDS = 6
LEAST_GOAL_RADIUS_CELLS = 2.0
# The way to a goal beside obstacles: more room than needed lets the robot pass without a stop ...
SPARE_M = 0.025
TIGHT_MOVE_M = 0.5  # ... and a move without it costs this much free path
NEAR_BACK_WEIGHT = 2.0  # over ground that the lidar has just seen


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticeOptions:
    """What the lattice planner prefers."""

    # Cost of a turn [m/rad]: free path per radian; more prefers wide curves and straight paths.
    turn_m_per_rad: Annotated[float, Ge(0)] = 0.10
    # Factor on the cost of driving backward; the robot is blind there.
    back_weight: Annotated[float, Ge(1)] = 5.0


class LatticePlanner:
    """`Planner` over position and heading."""

    def __init__(
        self, options: LatticeOptions, traversal: TraversalCostOptions, footprint: Footprint
    ) -> None:
        self._options = options
        self._traversal = traversal
        self._footprint = footprint
        self._astar = AStarPlanner(traversal)

    def search(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> Search[PlanResult]:
        """Return a path that the footprint can drive, shape (n, 2), about one cell between points.

        If there is none, returns A*'s path for the inscribed circle with a reason: the map may look narrower
        than the place is.
        """
        cells = self.cell_costs(costmap)
        ends = find_ends(costmap, cells, map_from_base, goal, self._traversal.escape_radius_m)
        if isinstance(ends, str):
            return PlanResult(reason=ends)
        poses = yield from self.search_poses(costmap, map_from_base, goal)
        if len(poses) == 0:
            fallback = yield from self._astar.search(costmap, map_from_base, goal)
            message = f"no drivable path to the goal {goal} is known yet: following the shortest one"
            return dataclasses.replace(fallback, reason=fallback.reason or message)
        poses[:, :2] = (poses[:, :2] - costmap.origin_m) / costmap.resolution_m
        points = np.vstack((poses[:, :2], ends.goal_cells))
        moved = np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-6)
        path = resample(points[moved], 1.0) if moved.sum() > 1 else np.repeat(points[:1], 2, axis=0)
        smooth(cells, path, SMOOTHING_ROUNDS)
        return PlanResult(path_m=path * costmap.resolution_m + costmap.origin_m)

    def plan(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> PlanResult:
        """Run `search` at once."""
        return run_to_end(self.search(costmap, map_from_base, goal))

    def poses(self, costmap: Costmap, map_from_base: Pose2, goal: Goal) -> FloatArray:
        """Run `search_poses` at once."""
        return run_to_end(self.search_poses(costmap, map_from_base, goal))

    def search_poses(
        self, costmap: Costmap, map_from_base: Pose2, goal: Goal, *, known_ground: bool = False
    ) -> Search[FloatArray]:
        """Return the poses (x, y, theta) of the path, shape (n, 3) [m, rad], or none, shape (0, 3).

        With `known_ground` the robot does not back up or rotate over unknown cells.
        """
        cells = self.cell_costs(costmap)
        ends = find_ends(costmap, cells, map_from_base, goal, self._traversal.escape_radius_m)
        if isinstance(ends, str) or not np.isfinite(cost_at(cells, *divmod(ends.goal, cells.costs.shape[1]))):
            return np.empty((0, 3))
        cell_m = costmap.resolution_m
        grid = self._in_cells(costmap, costmap, self._footprint)
        robot = np.append(ends.start_cells, map_from_base.theta_rad)
        poses = np.empty((0, 3))
        for guided, margin in ((True, NEAR_MARGIN), (False, FAR_MARGIN)):
            potential = yield from search_dijkstra(cells, ends.goal, ends.start, guided, margin)
            if potential[ends.start] == 0.0:
                break
            problem = LatticeProblem(
                cells=cells,
                potential=potential,
                grid=grid,
                roomy=grid,
                starts=robot[None],
                start_costs=np.zeros(1),
                end=(np.array((goal.x_m, goal.y_m)) - costmap.origin_m) / cell_m,
                end_radius=max(LEAST_GOAL_RADIUS_CELLS, goal.tolerance_m / cell_m),
                robot=robot,
                backward=False,
            )
            poses = yield from search_lattice(problem, self._weights(cell_m, known_ground))
            if len(poses):
                break
        poses[:, :2] = poses[:, :2] * cell_m + costmap.origin_m
        return poses

    def search_poses_to(
        self,
        costmap: Costmap,
        fine: Costmap,
        map_from_base: Pose2,
        ends: FloatArray,
        end_costs_m: FloatArray,
    ) -> Search[FloatArray]:
        """Return poses, shape (n, 3), that lead exactly to one of the ends, shape (m, 3); or none.

        The headings of the ends differ by multiples of the lattice's; each has a cost, shape (m,), in metres
        of free space. Searches from the ends back to the robot, which then turns to the first pose. The way
        keeps `SPARE_M` more than needed where it can; `fine` is the costmap in cells as fine or finer.
        """
        cells = self.cell_costs(costmap)
        x_m, y_m, _ = ends[0]
        found = find_ends(
            costmap, cells, map_from_base, Goal(x_m=x_m, y_m=y_m), self._traversal.escape_radius_m
        )
        if isinstance(found, str):
            return np.empty((0, 3))
        cell_m = costmap.resolution_m
        potential = yield from search_dijkstra(cells, found.start, -1, False, FAR_MARGIN)
        yield
        starts = ends.copy()
        starts[:, :2] = (ends[:, :2] - costmap.origin_m) / cell_m
        problem = LatticeProblem(
            cells=cells,
            potential=potential,
            grid=self._in_cells(costmap, fine, self._footprint),
            roomy=self._in_cells(costmap, fine, self._footprint.grown(SPARE_M)),
            starts=starts,
            start_costs=end_costs_m / cell_m,
            end=found.start_cells,
            end_radius=LEAST_GOAL_RADIUS_CELLS,
            robot=np.append(found.start_cells, map_from_base.theta_rad),
            backward=True,
        )
        weights = self._weights(cell_m, known_ground=True)
        weights = weights._replace(
            reverse=min(weights.reverse, NEAR_BACK_WEIGHT), tight=TIGHT_MOVE_M / cell_m
        )
        poses = yield from search_lattice(problem, weights)
        poses[:, :2] = poses[:, :2] * cell_m + costmap.origin_m
        return poses

    def cell_costs(self, costmap: Costmap) -> CellCosts:
        """Return the traversal cost of each cell."""
        return traversal_cost(costmap, self._traversal)

    def path_cost_m(self, costmap: Costmap, path_m: FloatArray) -> float:
        """Return the cost of a path [m of free space]; inf if it enters what the options forbid."""
        return path_cost_m(costmap, self.cell_costs(costmap), path_m)

    def _weights(self, cell_m: float, known_ground: bool) -> LatticeWeights:
        return LatticeWeights(
            turn=self._options.turn_m_per_rad / cell_m,
            reverse=self._options.back_weight,
            heuristic=HEURISTIC_WEIGHT,
            escape_radius=self._traversal.escape_radius_m / cell_m,
            max_nodes=MAX_NODES,
            known_ground=known_ground,
            tight=0.0,
        )

    @staticmethod
    def _in_cells(costmap: Costmap, checked: Costmap, footprint: Footprint) -> CollisionGrid:
        """Return what the outline is checked in, with lengths in cells of `costmap`."""
        grid, cell_m = CollisionGrid.from_costmap(checked, footprint), costmap.resolution_m
        return grid._replace(
            origin=(grid.origin - costmap.origin_m) / cell_m,
            resolution=grid.resolution / cell_m,
            outline=grid.outline / cell_m,
        )
