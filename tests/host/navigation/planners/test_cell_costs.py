"""Costs are looked up where a search comes by, and the edge of the map is closed."""

from pathlib import Path

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.common.resumable import run_to_end
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap, part_of
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.astar_search import CLOSED, NO_GOAL, astar, search_astar
from thumper.navigation.planners.cell_costs import CellCosts, cost_at
from thumper.navigation.planners.dijkstra import dijkstra, search_dijkstra
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions, traversal_cost
from thumper.offline.compile_kernels import memory_MB

ROWS, COLS = 23, 31
OPTIONS = TraversalCostOptions()


def random_costmap(seed: int) -> Costmap:
    rng = np.random.default_rng(seed)
    cells = rng.choice((0, 0, 0, 0, 0, 0, 0, 100, -1), (ROWS, COLS)).astype(np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.3, origin_x_m=0.0, origin_y_m=0.0)
    return build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())


def with_closed_edge(cells: CellCosts) -> CellCosts:
    costs = np.full((ROWS, COLS), LETHAL, np.uint8)
    costs[1:-1, 1:-1] = cells.costs[1:-1, 1:-1]
    return cells._replace(costs=costs)


@pytest.mark.parametrize("seed", range(12))
def test_the_edge_of_the_map_is_closed_to_the_searches(seed: int) -> None:
    cells = traversal_cost(random_costmap(seed), OPTIONS)
    closed = with_closed_edge(cells)
    whole = cells.part(slice(0, ROWS), slice(0, COLS))
    np.testing.assert_array_equal(whole, closed.table[closed.costs])
    assert all(cost_at(cells, *place) == whole[place] for place in np.ndindex(ROWS, COLS))
    np.testing.assert_array_equal(cells.part(slice(5, 23), slice(0, 9)), whole[5:23, :9])
    starts = np.flatnonzero(np.isfinite(whole))
    start, goal = int(starts[0]), int(starts[-1])
    for target in (NO_GOAL, goal):
        for one, other in zip(astar(cells, start, target), astar(closed, start, target), strict=True):
            np.testing.assert_array_equal(one, other)
        for guided in (False, True):
            np.testing.assert_array_equal(
                dijkstra(cells, start, target, guided, 6.0), dijkstra(closed, start, target, guided, 6.0)
            )


@pytest.mark.parametrize(
    "planner",
    [
        NavfnPlanner(OPTIONS),
        AStarPlanner(OPTIONS),
        # The kernels of the lattice are compiled again for the copy: 8 s.
        pytest.param(LatticePlanner(LatticeOptions(), OPTIONS, Footprint()), marks=pytest.mark.slow),
    ],
)
def test_a_part_of_a_costmap_is_planned_in_like_a_copy(planner: Planner) -> None:
    cells = np.zeros((120, 120), np.int8)
    cells[40:60, 60] = 100
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    costmap = build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())
    part = part_of(costmap, slice(10, 110), slice(10, 110))
    copied = Costmap(
        costs=part.costs.copy(),
        squared_cells=part.squared_cells.copy(),
        resolution_m=part.resolution_m,
        origin_x_m=part.origin_x_m,
        origin_y_m=part.origin_y_m,
    )
    start, goal = Pose2(x_m=2.0, y_m=2.5), Goal(x_m=4.0, y_m=2.5)
    one, other = planner.plan(part, start, goal).path_m, planner.plan(copied, start, goal).path_m
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one, other)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not report its memory")
def test_a_near_goal_in_a_large_map_takes_little_memory() -> None:
    side, middle = 4000, 4000 * 2000 + 2000
    cells = CellCosts(np.zeros((side, side), np.uint8), np.ones(256, np.float32))
    for _ in range(2):  # the first time compiles the kernels, or loads them
        before_MB = memory_MB()
        known = run_to_end(search_astar(cells, middle, middle + 60))
        potential = run_to_end(search_dijkstra(cells, middle, middle + 60, True, 6.0))
        taken_MB = memory_MB() - before_MB
    assert taken_MB < 12.0  # the arrays together have 290 MB
    assert known.status[middle + 60] == CLOSED
    assert potential[middle + 60] == pytest.approx(60.0, abs=1.5)
